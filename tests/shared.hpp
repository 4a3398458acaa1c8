// What several tests need: options in PETSc's database for a while, comparisons of two vectors.
#pragma once

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include "stickslip/base/error.hpp"
#include "stickslip/base/vectors.hpp"
#include "stickslip/model/friction.hpp"
#include "stickslip/model/model.hpp"
#include "stickslip/options/library_options.hpp"
#include "stickslip/options/options.hpp"
#include "stickslip/study/trial.hpp"
#include "stickslip/time/time.hpp"

namespace stickslip {

using Settings = std::vector<std::pair<std::string, std::string>>;

// The options of a `run`, with those of PETSc in its database while this lives.
class InDatabase {
 public:
  explicit InDatabase(const Settings& settings) : settings_(settings) {
    std::vector<Given> given;
    for (const auto& [name, text] : settings) given.push_back({name, text, ""});
    options = Options::from("run", given);
    insert_library_options(options);
  }
  ~InDatabase() {
    for (const auto& [name, text] : settings_) clear_library_option(name);
  }
  InDatabase(const InDatabase&) = delete;
  InDatabase& operator=(const InDatabase&) = delete;
  Options options;

 private:
  Settings settings_;
};

// The unknowns at the start, of which start(node, unknowns) says those of a node; held ends have theirs.
template <class Start>
VecHandle started(const Model& model, const Start& start) {
  VecHandle u = model.create_vector();
  {
    const Writing a(u);
    for (PetscInt i = 0; i < model.local(); ++i) start(model.first() + i, a + i * model.dof());
  }
  model.set_held(u);
  return u;
}

// What a run from there with these settings ends with, on every rank.
template <class Start>
Fields ended(const Scene& scene, const Settings& settings, double t, const Start& start) {
  const InDatabase given(settings);
  const Model model(PETSC_COMM_WORLD, scene);
  const VecHandle u = started(model, start);
  Integrator(model, MethodSpec::from(given.options), u).advance(u, 0, t, nullptr);
  return fields_of(model, u, scene.n);
}

// Calls body with the law that the parameters name.
template <class Body>
auto with_friction(const FrictionParameters& p, const Body& body) {
  return body(*Friction::of(p));
}

// Every combination is tried on one rank; on more, where each reduction waits for all of them, one of so
// many, others on each number of ranks.
inline bool in_turn(int combination, int ranks, int many = 13) {
  return ranks == 1 || (combination + ranks) % many == 0;
}
constexpr int numbers_of_ranks = 3;  // 2, 3 and 4: each combination on one of them

// max |a - b|
inline double distance(Vec a, Vec b) {
  VecHandle d;
  SS_TRY(VecDuplicate(a, d.out()));
  SS_TRY(VecWAXPY(d, -1, a, b));
  double norm;
  SS_TRY(VecNorm(d, NORM_INFINITY, &norm));
  return norm;
}

// Whether `part`, of the nodes of this rank, has the very bits that these nodes have in `whole`, which one
// rank holds.
inline bool same_bits(const Model& model, Vec part, Vec whole) {
  const double *mine, *all;
  SS_TRY(VecGetArrayRead(part, &mine));
  SS_TRY(VecGetArrayRead(whole, &all));
  const bool same = std::equal(mine, mine + model.local() * model.dof(), all + model.first() * model.dof());
  SS_TRY(VecRestoreArrayRead(part, &mine));
  SS_TRY(VecRestoreArrayRead(whole, &all));
  return same;
}

}  // namespace stickslip
