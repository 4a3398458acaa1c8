// The rightmost eigenvalues of steady sliding, with a check that none was missed.
//
// Three ways to the eigenvalues, one the other's oracle:
//   dense   every eigenvalue of the balanced matrix, by LAPACK (a few hundred nodes)
//   krylov  SLEPc's Krylov-Schur on Re (J - sigma)^-1 at shifts sigma beside the imaginary axis, each pair
//           then polished by Newton steps on S(lambda) p = 0; the work is linear in n Beyond 5000 nodes most
//           come from a coarser grid, or from the zeros that the count sees beside its line
//   exact   the discrete dispersion relation, where all nodes are alike: it only checks the other two
// A count of eigenvalues by the argument principle, on the determinant of the banded S(lambda), says how many
// stand to the right of the rightmost one found; where it finds some, it also says where to look, and the
// search goes on.
#pragma once

#include <petscsys.h>

#include <optional>
#include <string>
#include <vector>

#include "stickslip/stability/linearised_operator.hpp"

namespace stickslip {

struct Mode {
  Complex value;             // lambda, Im >= 0; its conjugate is an eigenvalue too
  std::vector<Complex> psi;  // at the nodes solved for, largest entry 1
  double residual = 0;       // |J x - lambda x|/|x| of the whole eigenvector
  double wavenumber = 0;     // with the symbol equal to the mode's mean of -D2
  bool resolved = true;
};

enum class SpectrumMethod { automatic, dense, krylov };

struct SpectrumSettings {
  PetscInt count = 12;  // eigenvalues wanted, conjugates counted apart
  SpectrumMethod method = SpectrumMethod::automatic;
  bool refine = true;      // continuum: compare with a finer grid, and look only where the grid can resolve
  bool compare = true;     // false: look only where the grid can resolve, and leave out the finer grid
  bool quick = false;      // only what the shifts find: nothing is counted
  bool whole_list = true;  // false: only the rightmost mode is made certain of
  double effort = 3e9;     // node evaluations that the count may cost
  // nodes beyond which modes are sought where the count sees zeros, not by many shifts
  std::size_t long_from = 5000;
};

struct Spectrum {
  // Rightmost first, equal real parts by frequency. Where grids are compared: those with a frequency that the
  // grid carries.
  std::vector<Mode> modes;
  double growth = 0, frequency = 0;  // of the rightmost resolved mode; NaN where none is resolved
  double error = 0;                  // of growth, estimated
  // growth < -error, the neutral mode of a chain without k0 excepted; where grids are compared also the waves
  // of the continuum that the grid does not carry must decay.
  bool stable = false;
  std::string method;  // "dense" or "krylov"
  // largest distance of a mode from the exact discrete relation, relative
  std::optional<double> dispersion_error;
  bool complete = false;       // no mode right of the first listed is missing
  bool list_complete = false;  // none is missing right of the last one listed
  // so many are, conjugates and multiplicity counted; empty where it is not known
  std::optional<long> missing;
  std::string completeness_check;
  bool degenerate = false;  // several modes share the growth rate; the one of the lowest frequency leads
  // The continuum where all nodes are alike: the largest growth rate over all its wavenumbers, and the
  // smallest of them that has it, empty where it is approached as they grow. Both empty for chains and where
  // nodes differ.
  std::optional<double> growth_continuum, wavenumber_continuum;
  std::vector<std::string> remarks;  // what a reader of growth and stable must know
};

// Collective: shifts are shared among the ranks of comm; every rank returns the same.
Spectrum compute_spectrum(MPI_Comm comm, const LinearisedOperator& J, const SpectrumSettings& settings);

// Newton steps on S(lambda) p = 0 from a guess; returns false where they do not converge. The residual and
// the wavenumber of the mode are set.
bool polish(const LinearisedOperator& J, Mode& mode, int steps = 8);

// The left eigenvector, w^T S(lambda) = 0, of a polished mode; not conjugated.
std::vector<Complex> left_vector(const LinearisedOperator& J, const Mode& mode);

// Takes psi of modes of one line from one grid to another, by cubics; 0 at held nodes.
void interpolate(const LinearisedOperator& from, const LinearisedOperator& to,
                 const std::vector<std::vector<Complex>*>& shapes);

// The frequency up to which the grid carries waves with less than 1 % of error; beyond it no mode of the
// continuum is to be had from this grid. No limit in the chain.
double resolved_frequency(const LinearisedOperator& J);

// The mode that is a symmetry, not an instability (LinearisedOperator::neutral).
bool is_neutral(const LinearisedOperator& J, const Mode& mode);

// Up to `count` modes near sigma = (shift right of the axis) + i omega, not polished.
std::vector<Mode> krylov_modes(const LinearisedOperator& J, Complex sigma, PetscInt count);

// Every mode, by LAPACK; the eigenvectors of the `count` rightmost only.
std::vector<Mode> dense_modes(const LinearisedOperator& J, PetscInt count);

// The number of eigenvalues with real part above `a` and |Im| < height, by the turn of the characteristic
// polynomial's phase round that box; empty where an eigenvalue stands on its edge, or the work would exceed
// `effort` node evaluations. `where`: places near which the count says that such eigenvalues stand, some of
// them. Collective.
std::optional<long> count_right(MPI_Comm comm, const LinearisedOperator& J, double a, double height,
                                double effort, std::vector<Complex>* where = nullptr);

}  // namespace stickslip
