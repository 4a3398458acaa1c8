// Dahl's friction, z_t = psi (1 - sgn(psi) sigma0 z/fc), F = sigma0 z: a spring that yields at fc (P. Dahl,
// AIAA J. 14 (1976) 1675). It depends on the path alone, not on how fast it is gone.
#pragma once

#include "model/laws/lugre.hpp"

namespace stickslip {

struct Dahl : OfBristles<Dahl> {
  static constexpr const char* name = "dahl";
  static constexpr double sigma1 = 0, sigma2 = 0;
  double fc = 0.5, sigma0 = 100;
  static std::vector<Declared<Dahl>> parameters() {
    using R = Parameter::Range;
    return {{&Dahl::fc, {"fc", "0.5", R::not_negative, "", ""}},
            {&Dahl::sigma0, {"sigma0", "100", R::positive, "1/length", ""}}};
  }
  void check() const {
    if (fc == 0)
      throw UsageError("-friction_fc 0: above 0 with this law, or the bristles have no deflection");
  }
  LawScales scales() const { return {0, fc, fc / sigma0, fc / sigma0}; }
  template <class Real>
  WithSlopeOf<Real> largest(Real) const {
    return {fc / sigma0, 0.};
  }
};

}  // namespace stickslip
