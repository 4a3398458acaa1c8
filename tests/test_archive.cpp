// What is named to an archive is saved and restored: every kind of entry, on any number of ranks, and what
// does not fit.

#include <cmath>
#include <limits>

#include "catch.hpp"
#include "stickslip/base/root.hpp"
#include "stickslip/base/vectors.hpp"
#include "stickslip/output/checkpoint.hpp"

using namespace stickslip;

namespace {

struct Moment {
  double t = 0;
  std::vector<double> psi = {};
};

// One of every kind of entry; of `each` nodes on a rank.
struct Kept {
  double real = 0, least = 0;
  long count = 0;
  bool is_on = false;
  std::vector<double> list, low, high, energies = std::vector<double>(2);
  std::vector<Moment> moments;
  std::vector<std::vector<double>> spread;
  VecHandle field;

  explicit Kept(PetscInt each) : spread(2, std::vector<double>(std::size_t(each))) {
    SS_TRY(VecCreateMPI(PETSC_COMM_WORLD, 2 * each, PETSC_DETERMINE, field.out()));
  }
  void archive(Archive& a) {
    const std::size_t ranks = std::size_t(ranks_in(PETSC_COMM_WORLD)),
                      rank = std::size_t(rank_in(PETSC_COMM_WORLD));
    a("real", real);
    a("is_on", is_on);
    a("list", list);
    a("mixed", least, count, is_on);
    a.list("moments", [&](NumberList& x) {
      x(count);
      x.rest(moments, [&](Moment& moment) {
        moment.psi.resize(2);
        x(moment.t, moment.psi);
      });
    });
    a("field", field);
    a.nodes("ranges", {&low, &high});
    std::vector<Archive::Own> own;  // in an order of its own
    const std::size_t each = spread[0].size();
    for (std::size_t k = 0; k < 2; ++k)
      for (std::size_t i = 0; i < each; ++i)
        own.push_back({(k * each + i) * ranks + ranks - 1 - rank, &spread[k][i]});
    a.spread("spread", 2 * each * ranks, own);
    a.by_rank("energies", energies);
  }
};

NodeRange range(PetscInt each) {
  const int rank = rank_in(PETSC_COMM_WORLD), ranks = ranks_in(PETSC_COMM_WORLD);
  return {PETSC_COMM_WORLD, each * rank, each, each * ranks};
}

// Of a checkpoint that keeps its fields in memory.
std::string refused(const Checkpoint& checkpoint, PetscInt each) {
  Archive a = Archive::from(checkpoint, range(each));
  try {
    Kept(each).archive(a);
  } catch (const std::exception& e) {
    return e.what();
  }
  return "";
}

}  // namespace

TEST_CASE("archive: what is saved is restored to the last bit, and what does not fit is named", "[output]") {
  const PetscInt each = 3;
  const double rank = rank_in(PETSC_COMM_WORLD);
  Kept kept(each);
  kept.real = 1. / 3;
  kept.least = -std::numeric_limits<double>::infinity();
  kept.count = -7;
  kept.is_on = true;
  kept.list = {0.1, -0.};
  kept.moments = {{0.1, {1, 2}}, {0.2, {3, std::nextafter(4, 5)}}};
  kept.low = {0.1 + rank, 0.2, 0.3};
  kept.high = {1.1, 1.2 + rank, 1.3};
  kept.spread = {{-0., NAN, rank}, {0.7, -0.1, HUGE_VAL}};
  kept.energies = {0.1 + rank, -1};
  {
    const Writing u(kept.field);
    for (PetscInt i = 0; i < 2 * each; ++i) u[i] = 0.1 * double(i) + rank;
  }
  Checkpoint checkpoint;
  checkpoint.t = 0.5;
  Archive to = Archive::to(checkpoint, range(each));
  CHECK(to.has("anything"));
  kept.archive(to);
  CHECK(checkpoint.numbers.at("is_on") == 1);
  CHECK(checkpoint.arrays.at("mixed") == std::vector<double>{kept.least, -7, 1});
  CHECK(checkpoint.arrays.at("moments").size() == 7);
  CHECK(checkpoint.fields.at("ranges") == std::vector<double>{0.1 + rank, 1.1, 0.2, 1.2 + rank, 0.3, 1.3});

  Kept other(each);
  Archive from = Archive::from(checkpoint, range(each));
  CHECK((from.restores() && !to.restores() && from.t() == 0.5 && from.has("list") && !from.has("none")));
  other.archive(from);
  CHECK((other.real == kept.real && other.least == kept.least && other.count == -7 && other.is_on));
  CHECK((other.list == kept.list && std::signbit(other.list[1])));
  CHECK((other.moments.size() == 2 && other.moments[1].t == 0.2 &&
         other.moments[1].psi == kept.moments[1].psi));
  CHECK((other.low == kept.low && other.high == kept.high && other.energies == kept.energies));
  CHECK((std::signbit(other.spread[0][0]) && std::isnan(other.spread[0][1]) && other.spread[0][2] == rank));
  CHECK(other.spread[1] == kept.spread[1]);
  CHECK(local_values(other.field) == local_values(kept.field));

  const auto without = [&](const char* name) {
    Checkpoint c = checkpoint;
    c.arrays.erase(name);
    c.numbers.erase(name);
    return refused(c, each);
  };
  CHECK(without("real") == "it has no 'real'");
  CHECK(without("spread") == "it has no 'spread'");
  const auto with = [&](const char* name, const std::vector<double>& numbers) {
    Checkpoint c = checkpoint;
    c.arrays[name] = numbers;
    return refused(c, each);
  };
  CHECK(with("mixed", {0, 1}) == "its 'mixed' does not fit");
  CHECK(with("mixed", {0, 1, 1, 1}) == "its 'mixed' does not fit");
  for (const double no_integer : {0.5, 1e300, HUGE_VAL, double(NAN)})
    CHECK(with("mixed", {0, no_integer, 1}) == "its 'mixed' does not fit");
  CHECK(with("mixed", {0, 1, 2}) == "its 'mixed' does not fit");
  CHECK(with("moments", {0, 1, 2}) == "its 'moments' does not fit");
  CHECK(with("spread", {1}) == "its 'spread' does not fit");
  CHECK(with("energies", {1, 2, 3}) == "its 'energies' does not fit");
}

TEST_CASE("archive: on another number of ranks rank 0 takes what all of them had added up", "[output]") {
  const int ranks = ranks_in(PETSC_COMM_WORLD);
  Checkpoint c;
  for (int k = 0; k <= ranks; ++k) c.arrays["energies"].insert(c.arrays["energies"].end(), {1, 0.5});
  Archive a = Archive::from(c, range(1));
  std::vector<double> own(2);
  a.by_rank("energies", own);
  const double all = rank_in(PETSC_COMM_WORLD) == 0 ? ranks + 1 : 0;
  CHECK(own == std::vector<double>{all, all / 2});
}
