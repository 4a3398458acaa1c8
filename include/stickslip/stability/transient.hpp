// What the eigenvalues leave out: how far perturbations of steady sliding can grow before the spectrum has
// its say, and how far a small change of the scene moves it. The operator is not normal.
//
// The norm is the energy |(p, e, t)|^2 = sum of weight (|e|^2 + conj(p) K p/A + |t|^2), K = K0 - K1 D2, which
// waves without friction conserve. There is none where D2 is not symmetric (held ends of order 4 and 6), nor,
// without the exact relation, where the line slides as a whole.
//
// Source: L. N. Trefethen and M. Embree, Spectra and Pseudospectra, Princeton 2005, sections 14 to 17.
#pragma once

#include <petscsys.h>

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "stickslip/stability/linearised_operator.hpp"

namespace stickslip {

struct Transient {
  double abscissa = 0;  // the fastest growth rate of any perturbation at first (numerical abscissa), 1/time
  // Largest |exp(J t)| over t >= 0, and when it is reached, both refined (`wavenumbers`: to 1e-9, and nothing
  // beyond 1e-4 is overlooked; `dense`: of up to 800 samples the highest refined; `iteration`: the highest,
  // to 1e-6). 1 and 0 where nothing grows. Meaningful for stable sliding only.
  double growth = 1, time = 0;
  std::string method;    // "wavenumbers", "dense" or "iteration"
  bool exact = true;     // false: growth is a lower bound
  double frequency = 0;  // iteration: of the fastest waves that it carries
};

// By wavenumber where the exact relation applies, dense up to 400 unknowns elsewhere, beyond (or with
// `iterate`) by banded matrices: the abscissa by halving (Cholesky's factorisation says on which side it
// lies), the growth by Lanczos' iteration on exp(J t) and its adjoint, stepped by a rational approximation.
// `growth_rate`: of the spectrum. Nothing where there is no such norm, nor by banded matrices with viscosity
// between neighbours. Not collective.
std::optional<Transient> transient_growth(const LinearisedOperator& J, double growth_rate,
                                          bool iterate = false);

// The resolvent norm |(z - J)^-1|, in units of time, by Lanczos' iteration on banded solves, to 1e-4; NaN
// where there is no such norm. Not collective.
double resolvent_norm(const LinearisedOperator& J, Complex z);
// At every (re, im), re fastest; empty where there is no such norm. In closed form where waves are exact and
// there is no state. Collective over comm, which shares the work; the same on every rank. `told`: called
// after each point with the part of the work that is done.
std::vector<double> pseudospectrum(MPI_Comm comm, const LinearisedOperator& J, const std::vector<double>& re,
                                   const std::vector<double>& im,
                                   const std::function<void(double)>& told = {});

}  // namespace stickslip
