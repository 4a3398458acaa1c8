// psi at a few nodes after every step of a run, to tell whether another run goes through the same motion.
#pragma once

#include <optional>
#include <vector>

#include "stickslip/model/model.hpp"
#include "stickslip/output/observer.hpp"

namespace stickslip {

class PsiRecord : public Observer {
 public:
  explicit PsiRecord(const Model& model);
  void step(const ObservedStep& step) override;

  // The first time at which psi is further than `room`, in parts of half the range of the true motion, from
  // all that the true one goes through within `lag` of that time, in parts of it; empty where there is none.
  std::optional<double> leaves(const PsiRecord& truth, double room, double lag) const;
  // The mean time between passages upwards through the middle of its range, at the node where that is
  // largest, in the second half of the run; empty with fewer than three such times, or where one is off by
  // more than this part of it.
  std::optional<double> period(double irregular) const;

 private:
  struct Range {
    double low, high;
  };
  Range range(std::size_t node, double from) const;
  Range within(std::size_t node, double from, double to) const;
  double at(std::size_t node, double t) const;  // straight between steps

  PetscInt first_, local_;
  int dof_;
  MPI_Comm comm_;
  std::vector<PetscInt> nodes_;
  std::vector<double> t_;
  std::vector<std::vector<double>> psi_;  // of every node
};

}  // namespace stickslip
