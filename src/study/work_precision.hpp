// Error against processor time of a scene, row by row, with the reference that the errors are taken from: the
// inside of `chart` (see chart.hpp).
#pragma once

#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "base/pulse.hpp"
#include "stickslip/study/chart.hpp"
#include "study/ladder.hpp"

namespace stickslip {

// The solution of a semi-discrete system with an error in time far below any other: by two methods of high
// order, whose distance is taken as its error. Explicit ones where they can finish within the time that they
// have, else implicit ones.
struct Converged {
  Scene scene;
  Answer answer;
  double time_error = 0;
  double seconds = 0;
  std::string method, failed;
};

class WorkPrecision {
 public:
  // The rows to be measured. Throws UsageError where they cannot be had.
  explicit WorkPrecision(const Options& options);

  // The solution of the differential equation, as chart_reference says, and that of each grid. Throws
  // UsageError where a file does not fit, Failure where no grid can be solved. Collective.
  void find_references();
  // In the order of chart_settings(). Collective.
  void run_rows();

  const std::vector<ChartRow>& rows() const { return rows_; }            // those done so far
  std::optional<double> reference_error() const;                         // empty: not known
  const std::string& reference_text() const { return reference_text_; }  // what it is, in words

 private:
  const Converged& converged(int order, PetscInt n);
  Converged converge_in_time(int order, PetscInt n) const;
  // Of what errors are of (chart_of), the second seen at the nodes of the first.
  double apart(const Answer& one, const Scene& there, const Answer& other, const Scene& of_other) const;
  void read_reference();
  void refine_reference();
  bool reference_suffices(double in_space, const Converged& fine);
  std::string described(double before, double last, int order) const;
  double difference(const Converged& coarse, const Converged& fine) const;
  ChartRow measure(const Setting& setting);
  bool looser_took_too_long(const Setting& setting) const;
  Trial repeated(const Setting& setting, ChartRow& row) const;
  void compare(const Answer& end, ChartRow& row);

  const Options& options_;
  Scene scene_;
  Quantity of_;
  std::vector<Setting> settings_;
  Progress progress_;
  std::map<std::pair<int, PetscInt>, Converged> converged_;  // by order and nodes
  std::optional<Converged> reference_;                       // of the differential equation
  double reference_error_;
  std::string reference_text_;
  std::vector<ChartRow> rows_;
};

// The grid with half the cells; 0 where the nodes of the coarser grid would not be among those of this one,
// or too few for the order.
PetscInt halved(const Scene& scene, PetscInt n, int order);

}  // namespace stickslip
