// Rows against time where only what slides is advanced (time/clusters.hpp).
#pragma once

#include <functional>
#include <utility>
#include <vector>

#include "model/moved_nodes.hpp"
#include "stickslip/output/archive.hpp"

namespace stickslip {

// One row for each time, the last one that is put there. It is written once a later time is told of, so that
// a run that goes on from a checkpoint writes the same rows: it takes over those before the checkpoint's
// time.
class RowOfTime {
 public:
  using Write = std::function<void(double t, const std::vector<double>& row)>;

  // Times do not go back.
  void put(double t, std::vector<double> row, const Write& write) {
    write_until(t, write);
    t_ = t;
    row_ = std::move(row);
  }
  void write_until(double t, const Write& write) {
    if (row_.empty() || !(t_ < t)) return;
    write(t_, row_);
    row_.clear();
  }
  void archive(Archive& a, const std::string& name) {
    a.list(name, [&](NumberList& x) {
      x(t_);
      x.rest(row_);
    });
  }

 private:
  double t_ = 0;
  std::vector<double> row_;  // empty: none
};

// Says when some nodes do anything but rest in closed form.
class Attention {
 public:
  Attention(const std::vector<PetscInt>& nodes, PetscInt all)
      : nodes_(nodes), all_(all), advanced_(nodes.size(), 0.) {}

  bool moved(const MovedNodes& m) const {
    for (const PetscInt i : nodes_)
      if (m.place(i, all_) >= 0) return true;
    return false;
  }
  // Whether one has joined a cluster, or left all.
  bool changed(const MediumNow& now) {
    bool any = false;
    for (std::size_t k = 0; k < nodes_.size(); ++k) {
      const double is = now.is_advanced(nodes_[k]) ? 1 : 0;
      any = any || is != advanced_[k];
      advanced_[k] = is;
    }
    return any;
  }
  void archive(NumberList& x) { x(advanced_); }

 private:
  const std::vector<PetscInt>& nodes_;
  PetscInt all_;
  std::vector<double> advanced_;
};

}  // namespace stickslip
