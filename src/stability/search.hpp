// The search for the rightmost modes of a line too long for a dense matrix.
//
// Guesses come from Krylov spaces at shifts, from segments of the line, from coarser grids, from sine waves;
// all are polished. Then the eigenvalues right of the last one listed are counted. While the count names more
// than are known, the search goes on where they must be: it is narrowed down to a gap between known real
// parts, then in frequency. Every step is a list of tasks shared among the ranks and put together in the
// order of the tasks, so that the number of ranks does not matter.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "stability/closed_form.hpp"
#include "stability/modes.hpp"
#include "stickslip/stability/spectrum.hpp"

namespace stickslip {

class ModeSearch {
 public:
  ModeSearch(MPI_Comm comm, const LinearisedOperator& s, const SpectrumSettings& settings, double height);
  // The modes found, rightmost first, and in `result` what is known of them: complete, list_complete,
  // missing, completeness_check. Collective; the same on every rank. Throws Failure where nothing is found.
  std::vector<Mode> run(Spectrum& result);
  // Between the rightmost mode and the line right of which all are counted.
  double margin() const { return margin_; }

 private:
  using Task = std::function<std::vector<Mode>(std::size_t)>;
  struct Count {
    long all, known;  // eigenvalues right of a line, and those of them that are modes known
  };
  struct Line {
    double at, slack;  // it may be moved by that much without passing a known mode
  };

  bool in_reach(const Mode& m) const { return m.value.imag() <= height_; }
  bool leads(const Mode& m) const { return in_reach(m) && !is_neutral(s_, m); }
  const Mode* rightmost() const;

  std::vector<std::vector<Mode>> distribute(std::size_t tasks, const Task& task) const;
  void select(std::vector<Mode>& guesses) const;
  void take(std::vector<Mode> guesses);
  void try_shifts(const std::vector<Complex>& shifts, PetscInt count);
  void try_places(const std::vector<Complex>& places);
  bool try_twins(std::size_t members);
  void try_segments(bool quick, bool inside);
  void try_coarse_grid();
  bool try_resolved();
  void first_guesses();
  void scan(std::vector<Complex> places, double line, int round);

  Line list_line(std::size_t listed) const;
  std::optional<Count> count(double line, std::vector<Complex>* where = nullptr) const;
  std::optional<Count> count(const Line& line, std::vector<Complex>* where = nullptr) const;
  std::size_t listed() const;
  bool look_between(std::size_t members);
  bool close_list(Spectrum& result);
  void close_rightmost(Spectrum& result);
  std::vector<Complex> unknown(std::vector<Complex> zeros) const;
  std::string counted_text(const Count& c, double line) const;

  MPI_Comm comm_;
  const LinearisedOperator& s_;
  const SpectrumSettings settings_;
  const double height_;
  const ExactModes exact_;
  const bool many_;  // too many nodes for many shifts
  const Tolerance tolerance_;
  const double own_;          // rate of the scene
  const std::size_t wanted_;  // pairs
  bool resolved_sought_;
  double margin_ = 0;
  std::vector<Mode> modes_;
};

}  // namespace stickslip
