#include "time/imex_columns.hpp"

#include <algorithm>
#include <cmath>

namespace stickslip {

namespace {
constexpr int most_terms = 48;
bool is_near(double a, double b) { return std::abs(a - b) < 1e-14; }
}  // namespace

ImexColumns::ImexColumns(const BandLayout& layout, const StageProgram& method, Implicit implicit)
    : dof_(layout.model().dof()),
      explicit_eta_(-layout.model().scene().s_delta() / layout.model().scene().A()),
      stride_(layout.size() + 8),  // so that columns do not meet in the same lines of a cache
      add_(kernel::compiled<std::function<void(const kernel::Terms&)>>(kernel::AddTerms{})) {
  int columns = 0;
  const std::size_t s = method.stages;
  for (int d = 0; d < dof_; ++d) {
    u_[d] = columns++;
    known_[d] = columns++;
  }
  stage_[0] = columns++;
  if (dof_ == 3) stage_[1] = columns++;
  d2_ = columns++;
  const bool wave = implicit == Implicit::wave;
  right_side_ = columns++;
  if (!wave) change_ = columns++;
  for (std::size_t i = 0; i < s; ++i)
    for (const Kind kind : {of_implicit, of_explicit}) {
      std::array<int, 3> own{-1, -1, -1};
      for (int d = 0; d < dof_; ++d) {
        const bool acts = kind == of_implicit ? !(wave && d == 2) : wave && d != 1;
        if (acts) own[d] = columns++;
      }
      slopes_[kind].push_back(own);
    }
  work_ = std::make_unique<double[]>(columns * std::size_t(stride_));
  PetscInt longest = 0;
  for (const BandTile& t : layout.tiles()) longest = std::max(longest, t.count());
  zeros_.assign(longest, 0.);

  sums_.resize(s);
  const double* const last = &method.At[(s - 1) * s];
  const bool stiffly_accurate = std::equal(method.bt.begin(), method.bt.end(), last, is_near);
  std::vector<double> of_explicit_left = method.b, of_last(s, 0.), none(s, 0.);
  of_last[s - 1] = last[s - 1];
  for (std::size_t j = 0; j < s && stiffly_accurate; ++j) of_explicit_left[j] -= method.A[(s - 1) * s + j];
  std::vector<double> f(s), g(s);
  for (std::size_t j = 0; j < s && !method.embedded.empty(); ++j) {
    f[j] = method.b[j] - method.embedded[j];
    g[j] = method.bt[j] - method.embedded_t[j];
  }
  for (int d = 0; d < dof_; ++d) {
    for (std::size_t i = 0; i < s; ++i) {
      sums_[i][d].base = d == 0 ? -1 : u_[d];
      add(sums_[i][d], d, &method.At[i * s], &method.A[i * s], int(i));
    }
    // a stiffly accurate method has the new u in its last stage but for what is explicit
    Sum& solution = solution_[d];
    solution.base = !stiffly_accurate ? u_[d] : d == 1 ? known_[1] : stage_[d == 0 ? 0 : 1];
    add(solution, d,
        !stiffly_accurate ? method.bt.data()
        : d == 1          ? of_last.data()
                          : none.data(),
        of_explicit_left.data(), int(s));
    add(error_[d], d, g.data(), f.data(), int(s));
  }
}

void ImexColumns::add(Sum& sum, int d, const double* implicit_weights, const double* explicit_weights,
                      int count) const {
  for (int j = 0; j < count; ++j)
    for (const Kind kind : {of_implicit, of_explicit}) {
      const bool of_psi = kind == of_explicit && d == 1;
      const double weight = (kind == of_implicit ? implicit_weights : explicit_weights)[j];
      const double factor = of_psi ? explicit_eta_ : 1;
      const int column = slopes_[kind][j][of_psi ? 0 : d];
      // round-off, which the tableau was read with
      if (column < 0 || factor == 0 || is_near(weight, 0)) continue;
      sum.columns.push_back(column);
      sum.weights.push_back(weight * factor);
    }
}

void ImexColumns::take(const BandTile& t, const Sum& sum, double dt, double* into) const {
  const double* terms[most_terms];
  double weights[most_terms];
  const auto count = sum.columns.size();
  for (std::size_t j = 0; j < count; ++j) {
    terms[j] = at(t, sum.columns[j]);
    weights[j] = dt * sum.weights[j];
  }
  add_({sum.base < 0 ? zeros_.data() : at(t, sum.base), terms, weights, int(count), into, t.count()});
}

void ImexColumns::sum_known(const BandTile& t, int i, double dt) const {
  for (int d = 0; d < dof_; ++d) take(t, sums_[i][d], dt, known(t, d));
}
void ImexColumns::sum_solution(const BandTile& t, int d, double dt, double* into) const {
  take(t, solution_[d], dt, into);
}
void ImexColumns::sum_error(const BandTile& t, int d, double dt, double* into) const {
  take(t, error_[d], dt, into);
}

}  // namespace stickslip
