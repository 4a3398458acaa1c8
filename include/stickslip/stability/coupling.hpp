// How the nodes that are solved for hang together: -D2 among them, and their order in a banded matrix. Where
// links differ along x (model/medium.hpp) D2 is that of the links over the mean K1, so that K1 times it is
// what couples them.
//
// Held nodes carry no unknown; what couples to them stands in the row sums alone. Local to the process, which
// holds the whole line.
#pragma once

#include <utility>
#include <vector>

#include "stickslip/model/scene.hpp"
#include "stickslip/numerics/band.hpp"

namespace stickslip {

class Coupling {
 public:
  explicit Coupling(const Scene& scene);
  // `count` nodes from the first'th on, everything outside held.
  Coupling segment(std::size_t first, std::size_t count) const;

  // those solved for, node[0] < node[1] < ...; columns below are places in this list
  std::vector<PetscInt> node;
  std::vector<double> weight;  // inner product: 1, 1/2 at a free end of the continuum
  bool symmetric = true;       // D2 is symmetric in that inner product: but for held ends of order 4 and 6
  std::size_t size() const { return node.size(); }

  struct Term {
    std::size_t column;
    double value;  // 1/length^2 in the continuum, a number in the chain
  };
  struct Row {
    const Term *first, *last;
    const Term* begin() const { return first; }
    const Term* end() const { return last; }
  };
  // Row i of -D2. Its product with p is taken by differences, which keep the digits that 1/h^2 would eat.
  Row row(std::size_t i) const { return {terms_.data() + starts_[i], terms_.data() + starts_[i + 1]}; }
  std::vector<Complex> minus_d2(const std::vector<Complex>& p) const { return minus_d2(p, false); }
  // `plain`: of the stencil with equal links, in any case.
  std::vector<Complex> minus_d2(const std::vector<Complex>& p, bool plain) const;
  double largest_row() const;  // sum of |entries|

  // A ring is ordered 0, n-1, 1, n-2, ..., so that neighbours stay near each other in the band.
  std::size_t position(std::size_t i) const;
  int band() const { return band_; }
  // lu += factor (-D2), in that order; solves with the factors of such a matrix, b in the order of the nodes.
  void add_to(BandLU& lu, Complex factor) const;
  void solve(const BandLU& lu, std::vector<Complex>& b, bool transposed = false) const;

 private:
  Coupling() = default;
  void add_link_row(const Scene& scene, PetscInt node);
  void close_row();

  // Values of the rows' terms with equal links, where they are not; and of their sums.
  std::vector<double> plain_, plain_sum_;
  bool folded_ = false;
  int band_ = 0;
  std::vector<std::size_t> starts_{0};
  std::vector<Term> terms_;
  std::vector<double> row_sum_;
};

}  // namespace stickslip
