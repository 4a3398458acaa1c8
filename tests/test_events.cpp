// The catalogue of slip events against motion that is known.
#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "catch.hpp"
#include "output/catalogue.hpp"
#include "stickslip/output/events.hpp"

using namespace stickslip;

namespace {

Scene chain(PetscInt n, bool ring) {
  Scene s;
  s.form = Form::chain;
  s.delta = 0;
  s.n = n;
  s.order = 2;
  s.left = s.right = ring ? End::periodic : End::free;
  s.length = double(ring ? n : n - 1);
  s.friction.law = Law("coulomb");
  return s;
}

// All that an event says.
std::vector<double> numbers(const SlipEvent& e) {
  std::vector<double> all = {
      e.begin,  e.end,    double(e.first), double(e.left),  double(e.count), double(e.direction),
      e.slip,   e.moment, e.stress_drop,   e.strain_energy, e.friction_work, e.radiated,
      e.kinetic};
  all.insert(all.end(), e.rupture.begin(), e.rupture.end());
  return all;
}

// psi at the nodes marked by capital letters is 1, elsewhere 0.
std::vector<std::vector<double>> picture(const std::string& row) {
  std::vector<std::vector<double>> fields(2, std::vector<double>(row.size(), 0.));
  for (std::size_t i = 0; i < row.size(); ++i) fields[0][i] = row[i] == '#' ? 1 : 0;
  return fields;
}

std::vector<SlipEvent> events_of(const Scene& scene, const std::vector<std::string>& rows) {
  Events events(scene, 0);
  std::vector<SlipEvent> all;
  for (std::size_t k = 0; k < rows.size(); ++k) {
    events.step(double(k), picture(rows[k]));
    for (const SlipEvent& e : events.ended()) all.push_back(e);
  }
  return all;
}

}  // namespace

TEST_CASE("events are regions that slip together", "[serial]") {
  // one grows, another is met; a third stays apart and ends first
  std::vector<SlipEvent> e = events_of(
      chain(12, false), {"............", "..#......#..", ".###.....#..", "..###.......", "....###.....",
                         "......#.....", "............", "............", "............"});
  REQUIRE(e.size() == 2);
  CHECK(e[0].first == 9);
  CHECK(e[0].count == 1);
  CHECK(e[0].begin == 0);
  CHECK(e[0].end == 3);  // psi comes to 0 in the step that ends there
  CHECK(e[1].first == 2);
  CHECK(e[1].left == 1);
  CHECK(e[1].count == 6);
  CHECK(e[1].end == 6);

  // two meet and become one, which has the earlier beginning
  e = events_of(chain(8, false), {"........", "#.......", "#.....#.", "##...##.", "###.##..", "..##....",
                                  "........", "........"});
  REQUIRE(e.size() == 1);
  CHECK(e[0].first == 0);
  CHECK(e[0].count == 7);

  // round the ring, not so between ends
  const std::vector<std::string> round = {"........", ".......#", "#.....##", "........", "........"};
  e = events_of(chain(8, true), round);
  REQUIRE(e.size() == 1);
  CHECK(e[0].left == 6);
  CHECK(e[0].count == 3);
  CHECK(events_of(chain(8, false), round).size() == 2);

  // what moves again in the region while something there still moves belongs to it, what does so later does
  // not
  e = events_of(chain(8, false), {"........", "#.......", "##......", ".##.....", "#.#.....", "..#.....",
                                  "........", "........", "#.......", "........", "........"});
  REQUIRE(e.size() == 2);
  CHECK(e[0].count == 3);
  CHECK(e[1].begin == 7);
}

TEST_CASE("when nodes first slip and how fast fronts run", "[serial]") {
  // around the seam of a ring; a node that moves again keeps its time
  Scene s = chain(8, true);
  Events ring(s, 0, {PETSC_COMM_SELF, 0, 8, 8}, true);
  const std::vector<std::string> rows = {"........", ".......#", "#.....##", "#......#",
                                         "##....#.", "........", "........"};
  for (std::size_t k = 0; k < rows.size(); ++k) ring.step(double(k), picture(rows[k]));
  std::vector<SlipEvent> e = ring.ended();
  REQUIRE(e.size() == 1);
  CHECK(e[0].left == 6);
  CHECK(e[0].rupture == std::vector<double>{1, 0, 1, 3});
  CHECK(std::isnan(front_of(e[0], s, 1).speed));

  // psi rises linearly through the velocity from which on a node moves
  Events smooth(s, 0.25, {PETSC_COMM_SELF, 0, 8, 8}, true);
  for (std::size_t k = 0; k < rows.size(); ++k) smooth.step(double(k), picture(rows[k]));
  e = smooth.ended();
  REQUIRE(e.size() == 1);
  CHECK(e[0].rupture == std::vector<double>{1.25, 0.25, 1.25, 3.25});

  // on a line the front to the right runs at 2 from the fourth node on, that to the left at 1 but for a node;
  // numpy.polyfit(times, places, 1, cov=True) gives the slope and its error
  s = chain(20, false);
  SlipEvent line;
  line.first = 10;
  line.left = 0;
  line.count = 20;
  for (int i = 0; i < 20; ++i) line.rupture.push_back(i < 10 ? 10 - i : i < 14 ? 0.1 * i : 0.5 * i);
  line.rupture[5] += 0.5;
  const Front right = front_of(line, s, 1), left = front_of(line, s, -1);
  CHECK(right.speed == Approx(2).epsilon(1e-13));
  CHECK(right.error < 1e-7);
  CHECK(left.speed == Approx(-1.029972752043596).epsilon(1e-11));
  CHECK(left.error == Approx(0.03814713896457784).epsilon(1e-9));
  line.count = 19;  // five nodes beyond the third on the right
  line.rupture.pop_back();
  CHECK(std::isnan(front_of(line, s, 1).speed));
  CHECK(front_of(line, s, -1).speed == left.speed);

  // a whole ring: the sides meet at the last node, 17
  s = chain(20, true);
  SlipEvent round;
  round.first = 5;
  round.left = 6;
  round.count = 20;
  for (int k = 1; k <= 20; ++k) round.rupture.push_back(k <= 12 ? 0.5 * k : k < 20 ? 0.7 * (20 - k) : 0);
  CHECK(front_of(round, s, 1).speed == Approx(2).epsilon(1e-13));
  CHECK(std::isnan(front_of(round, s, -1).speed));  // seven nodes, three of them passed over
}

TEST_CASE("events of nodes on several ranks are those of all nodes on one") {
  // nodes that move at random, rest and move again, on a ring and between ends, from fewer than a stencil
  // reaches a rank on
  int rank, ranks;
  MPI_Comm_rank(PETSC_COMM_WORLD, &rank);
  MPI_Comm_size(PETSC_COMM_WORLD, &ranks);
  std::mt19937 random(7);
  std::uniform_real_distribution<double> any(0, 1);
  for (const PetscInt n : {5, 40, 161}) {
    for (const bool ring : {true, false}) {
      Scene s = chain(n, ring);
      s.nu = n == 40 ? 0.3 : 0;
      const PetscInt first = n * rank / ranks, behind = n * (rank + 1) / ranks;
      Events whole(s, 0, {PETSC_COMM_SELF, 0, n, n}, true),
          shared(s, 0, {PETSC_COMM_WORLD, first, behind - first, n}, true);
      std::vector<bool> moves(std::size_t(n), false);
      std::vector<SlipEvent> all, parts;
      for (int k = 0; k < 60; ++k) {
        std::vector<std::vector<double>> fields(2, std::vector<double>(std::size_t(n), 0.)), own(2);
        for (std::size_t i = 0; i < std::size_t(n); ++i) {
          const double chance = any(random);
          moves[i] = moves[i] ? chance < 0.6 : chance < (k % 12 < 3 ? 0.2 : 0.01);
          if (moves[i] && k > 0) fields[0][i] = any(random) - 0.1;
          fields[1][i] = any(random);
        }
        for (std::size_t f = 0; f < 2; ++f)
          own[f].assign(fields[f].begin() + first, fields[f].begin() + behind);
        whole.step(0.1 * k, fields);
        shared.step(0.1 * k, own);
        for (const SlipEvent& e : whole.ended()) all.push_back(e);
        for (const SlipEvent& e : shared.ended()) parts.push_back(e);
      }
      CAPTURE(n, ring, ranks);
      CHECK(all.size() > (n == 5 ? 3 : 15));
      bool same = all.size() == parts.size();
      for (std::size_t k = 0; k < all.size() && same; ++k) {
        const std::vector<double> a = numbers(all[k]), b = numbers(parts[k]);
        same = a.size() == b.size() && PetscInt(a.size()) == 13 + all[k].count;
        for (std::size_t c = 0; c < a.size() && same; ++c)
          same = same && (std::abs(a[c] - b[c]) <= 1e-11 * (1 + std::abs(a[c])) ||
                          (std::isnan(a[c]) && std::isnan(b[c])));
      }
      CHECK(same);
    }
  }
}

TEST_CASE("the numbers of an event", "[serial]") {
  // One block of mass 2 under Coulomb's friction, eta falling linearly: psi_t = A (eta - fd), parabola in
  // time.
  Scene s = chain(3, false);
  s.m = 2;
  s.friction.values["friction_fd"] = 0.4;
  Events events(s, 0);
  const double A = s.A(), rate = 0.1, eta0 = 1;
  const auto psi = [&](double t) { return A * ((eta0 - 0.4) * t - rate * t * t / 2); };
  const double stops = 2 * (eta0 - 0.4) / rate;
  for (int k = -1; k <= 8; ++k) {
    const double t = k < 0 ? 0 : stops * k / 7;
    const double x = k < 1 || k > 6 ? 0 : psi(t);
    if (k >= 0) events.step(k == 8 ? stops + 1 : t, {{0, x, 0}, {0, eta0 - rate * std::min(t, stops), 0}});
  }
  const std::vector<SlipEvent> all = events.ended();
  REQUIRE(all.size() == 1);
  const SlipEvent& e = all[0];
  // Simpson's rule is exact
  const double slip = A * (0.6 * stops * stops / 2 - rate * stops * stops * stops / 6);
  CHECK(e.begin == 0);
  CHECK(e.end == Approx(stops));
  CHECK(e.slip == Approx(slip));
  CHECK(e.moment == Approx(slip));
  CHECK(e.stress_drop == Approx(rate * stops));
  CHECK(e.friction_work == Approx(0.4 * slip));
  CHECK(e.strain_energy == Approx(slip * (eta0 - rate * stops / 2)));
  CHECK(e.radiated == 0);
}

TEST_CASE("force before an event, which others have changed since it began", "[serial]") {
  // Blocks so heavy that psi is straight between the rows. The one at 1 moves all the time; those at 6 and 7
  // slip and come to rest; then one moves at 5, and the two regions grow together, over the place of the slip
  // that has ended.
  Scene s = chain(9, false);
  s.m = 1e14;
  s.k0 = 0.5;
  s.k1 = 1.5;
  s.v = 0.01;
  const std::vector<std::string> rows = {".........", ".#.......", ".#....##.", ".#.......",
                                         ".#.......", ".#...#...", ".##.###..", ".#####...",
                                         "..##.....", ".........", "........."};
  const std::size_t n = 9;
  const auto elastic = [&](const std::vector<double>& d, std::size_t i) {
    double force = s.k0 * d[i];
    if (i > 0) force += s.k1 * (d[i] - d[i - 1]);
    if (i + 1 < n) force += s.k1 * (d[i] - d[i + 1]);
    return force;
  };
  std::vector<double> all(n), first(n), start(n);
  for (std::size_t i = 0; i < n; ++i) start[i] = 0.3 + 0.1 * double(i % 4);
  std::vector<std::vector<double>> last, fields;
  const NodeRange range{PETSC_COMM_SELF, 0, s.n, s.n};
  Events events(s, 0, range, true), resumed(s, 0, range, true);
  for (std::size_t k = 0; k < rows.size(); ++k) {
    fields = picture(rows[k]);
    for (std::size_t i = 0; i < n && k > 0; ++i) {
      const double d = (fields[0][i] + last[0][i]) / 2;
      all[i] += d;
      if (k <= 3 && i >= 6) first[i] += d;
    }
    for (std::size_t i = 0; i < n; ++i) fields[1][i] = start[i] + s.k0 * s.v * double(k) - elastic(all, i);
    events.step(double(k), fields);
    if (k == 5) {
      Checkpoint saved;
      const NodeRange nodes{PETSC_COMM_SELF, 0, s.n, s.n};
      Archive to = Archive::to(saved, nodes), from = Archive::from(saved, nodes);
      events.archive(to);
      resumed.archive(from);
    }
    if (k > 5) resumed.step(double(k), fields);
    last = fields;
  }
  const std::vector<SlipEvent> ended = events.ended(), from_saved = resumed.ended();
  REQUIRE(ended.size() == 2);
  const auto check = [&](const SlipEvent& e, const std::vector<double>& d,
                         const std::vector<double>& slipped) {
    double drop = 0, strain = 0, moment = 0;
    for (std::size_t i = 0; i < n; ++i) {
      if (d[i] == 0) continue;
      // of its own slip, less the plate's pull
      const double fall = elastic(d, i) - s.k0 * s.v * (e.end - e.begin);
      const double behind = start[i] + s.k0 * s.v * e.end - elastic(slipped, i);
      drop += fall / double(e.count);
      strain += d[i] * (behind + fall / 2);
      moment += d[i];
    }
    CHECK(e.moment == Approx(moment));
    CHECK(e.stress_drop == Approx(drop));
    CHECK(e.strain_energy == Approx(strain));
  };
  CHECK(ended[0].count == 2);
  check(ended[0], first, first);
  std::vector<double> second = all;
  for (std::size_t i = 0; i < n; ++i) second[i] -= first[i];
  CHECK(ended[1].count == 6);
  CHECK(ended[1].begin == 0);
  check(ended[1], second, all);
  REQUIRE(from_saved.size() == 1);
  CHECK(numbers(ended[1]) == numbers(from_saved[0]));
}

TEST_CASE("what other events do is no part of one, until it ends and while its nodes moved in them",
          "[serial]") {
  // Each node's eta rests, so psi is straight between the rows and all of the drop is what the others did.
  // The one at 2 ends at t = 3, while the other, two nodes away, goes on; that one comes to 2 when it has
  // ended. Either way round.
  Scene s = chain(9, false);
  s.form = Form::continuum;
  s.order = 4;
  s.gamma = 2;
  s.delta = 0.4;
  const std::vector<std::string> rows = {".........", "..#......", "..#.#....", "....#....", "....##...",
                                         "..####...", "..#......", ".........", "........."};
  const auto done_by = [&](PetscInt i, PetscInt node, double slip) {
    double force = i == node ? -s.K0() * slip : 0;
    for (const auto& [j, factor] : second_difference_row(s, i))
      force += j == node ? s.K1() * factor * slip : 0;
    return force;
  };
  for (const int sign : {1, -1}) {
    Events events(s, 0);
    for (std::size_t k = 0; k < rows.size(); ++k) {
      std::vector<std::vector<double>> fields = picture(rows[k]);
      for (std::size_t i = 0; i < 9; ++i) {
        fields[0][i] *= sign;
        fields[1][i] = sign * (0.5 + 0.1 * double(i));
      }
      events.step(double(k), fields);
    }
    const std::vector<SlipEvent> ended = events.ended();
    REQUIRE(ended.size() == 2);
    CAPTURE(sign);
    const double slipped_beside = 1.5, slipped_before = 1.5, damped = s.delta / s.gamma;
    CHECK(ended[0].count == 1);
    CHECK(ended[0].stress_drop == Approx(done_by(2, 4, slipped_beside)));
    double drop = damped;
    for (PetscInt i = 2; i < 6; ++i) drop += done_by(i, 2, slipped_before);
    CHECK(ended[1].count == 4);
    CHECK(ended[1].stress_drop == Approx(drop / 4));
    for (const SlipEvent& e : ended) CHECK(e.direction == sign);
    CHECK(ended[0].slip == Approx(2));
    CHECK(ended[0].moment == Approx(2));
    CHECK(ended[1].moment == Approx(4 + 2 + 1 + 2));
  }
}

TEST_CASE("nodes side by side add up as nodes apart do", "[serial]") {
  // the same motion of 270 nodes, once in one region, in vector code, once with a node at rest between any
  // two
  std::mt19937 random(3);
  std::uniform_real_distribution<double> any(0, 1);
  const std::size_t nodes = 270;
  const int steps = 12;
  for (const char* law : {"cubic", "coulomb", "carlson-langer"}) {
    for (const char* state : {"none", "contact-age"}) {
      if (law == std::string("cubic") && state != std::string("none")) continue;
      SlipEvent sums[2];
      std::vector<double> psi, eta, age;  // drawn alike for both
      for (std::size_t k = 0; k < nodes * steps; ++k) {
        psi.push_back(any(random) + 0.1 - (k % 7 == 0 ? 1.5 : 0));
        eta.push_back(any(random));
        age.push_back(any(random) - 0.5);
      }
      for (const std::size_t apart : {1, 2}) {
        Scene s = chain(PetscInt(nodes * apart), false);
        s.friction.law = Law(law);
        s.friction.state = StateLaw(state);
        s.zeta = 0.3;
        const bool has_state = state != std::string("none");
        Events events(s, law == std::string("cubic") ? 1e-3 : 0);
        SlipEvent& sum = sums[apart - 1];
        for (int k = 0; k < steps + 3; ++k) {
          std::vector<std::vector<double>> fields(has_state ? 3 : 2, std::vector<double>(nodes * apart, 0.));
          for (std::size_t i = 0; i < nodes && k > 0 && k <= steps; ++i) {
            const std::size_t from = std::size_t(k - 1) * nodes + i;
            fields[0][i * apart] = psi[from];
            fields[1][i * apart] = eta[from];
            if (has_state) fields[2][i * apart] = age[from];
          }
          events.step(0.1 * k, fields);
          for (const SlipEvent& e : events.ended()) {
            sum.moment += e.moment;
            sum.friction_work += e.friction_work;
            sum.radiated += e.radiated;
            sum.strain_energy += e.strain_energy;
            sum.count += e.count;
          }
        }
      }
      CAPTURE(law, state);
      CHECK(sums[0].count == PetscInt(nodes));
      CHECK(sums[1].count == PetscInt(nodes));
      CHECK(sums[0].moment == Approx(sums[1].moment).epsilon(1e-12));
      CHECK(sums[0].friction_work == Approx(sums[1].friction_work).epsilon(1e-12));
      CHECK(sums[0].radiated == Approx(sums[1].radiated).epsilon(1e-12));
    }
  }
}
