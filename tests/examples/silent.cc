// A law that does not say whether friction jumps at rest: compiling it must fail, and the message must say why.
#include "model/law.hpp"

struct Silent : stickslip::LawDefaults {
  static constexpr const char* name = "silent";
  static std::vector<stickslip::Declared<Silent>> parameters() { return {}; }
};

constexpr bool jumps = stickslip::jumps_at_rest<Silent>();
