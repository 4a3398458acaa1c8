// A law that does not say whether friction jumps at rest: compiling it must fail, and the message must say why.
#include "model/law.hpp"

struct Silent {
  static constexpr const char* name = "silent";
  static std::vector<stickslip::Declared<Silent>> parameters() { return {}; }
};

constexpr bool jumps = stickslip::traits::jumps_at_rest<Silent>();
