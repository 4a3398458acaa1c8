// Does a grid that moves with the fronts pay? A prototype in one file that needs no library: the continuum
// with the cubic law, without a state, on rings and between a held (left) and a free (right) end, by explicit
// steps of Dormand and Prince 5(4).
//
// Nodes x_i(t) are the image of the uniform grid s_i under a smooth map x(s, t). With subscripts for
// derivatives and w = x_t (the velocity of a node, constant within a step)
//     psi_t at fixed s = gamma (eta - F(psi)) + w psi_s/x_s
//     eta_t at fixed s = (v - psi)/gamma + c^2/gamma (psi_ss/x_s^2 - x_ss psi_s/x_s^3) - delta (eta - F) + w
//     eta_s/x_s
// with centred differences of order 4 or 6 in s for the fields and for the map. The map follows the steepness
// of psi and eta: equidistribution of a monitor M = 1 - beta + beta m/mean(m), m = (psi_x^2 +
// eta_x^2)^(power/2), smoothed in s by exponentials of `reach` nodes to both sides, twice (Huang and Russell,
// "Adaptive moving mesh methods", 2011, chapters 2 and 4), and in time: a node gets to where it is wanted
// within `relax` steps.
//
// usage: bench_moving_grid SCENE [n=512] [order=6] [beta=0] [power=0.5] [reach=8] [relax=10] [tol=1e-6]
// [out=FILE]
//        [against=FILE] [end=T] [speed=1.02]
// with SCENE pacemaker, ring, stiff (the ring at gamma = 30), or train (of that speed over c, compared with
// its exact form). beta = 0 keeps the grid uniform, and nothing is paid for a map. Prints steps, seconds of
// processor time, the least spacing, and the largest error of psi, of eta, and the root mean square of both
// against a file that `out` wrote: values at 20001 even places, interpolated at order 8. docs/moving-grid.md
// has what came out.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <fstream>
#include <map>
#include <stdexcept>
#include <string>
#include <vector>

namespace {

using Field = std::vector<double>;

struct Scene {
  double gamma = 3, delta = 0, c = 1, v = 0.2, length = 60, end = 5;
  bool ring = true;
  double held = 0;
};

constexpr int halo = 4;  // nodes beyond each end in every array

// The fields of one time: psi, eta and the map, with room for `halo` nodes on either side.
struct State {
  Field psi, eta;
};

double phi(double psi) { return psi * psi * psi / 3 - psi; }

class Grid {
 public:
  Grid(const Scene& scene, int n, int order) : scene_(scene), n_(n), reach_(order / 2) {
    if (order != 4 && order != 6) throw std::runtime_error("order 4 or 6");
    x.resize(std::size_t(n + 2 * halo));
    w.assign(x.size(), 0);
    for (int i = 0; i < n; ++i) x[std::size_t(i + halo)] = i * h();
  }
  double h() const { return scene_.ring ? scene_.length / n_ : scene_.length / (n_ - 1); }

  // Values beyond the ends: `jump` is what x gains round the ring; `odd` for the map at both ends.
  void extend(Field& f, double jump) const {
    double* a = f.data() + halo;
    for (int k = 1; k <= halo; ++k) {
      if (scene_.ring) {
        a[-k] = a[n_ - k] - jump;
        a[n_ - 1 + k] = a[k - 1] + jump;
      } else if (jump != 0) {
        a[-k] = -a[k];
        a[n_ - 1 + k] = 2 * jump - a[n_ - 1 - k];
      } else {
        a[n_ - 1 + k] = a[n_ - 1 - k];
      }
    }
    if (!scene_.ring && jump == 0) held_end(a);
  }
  // The polynomial of degree p - 1 through the first p nodes.
  void held_end(double* a) const {
    const int p = 2 * reach_;
    for (int k = 1; k <= reach_; ++k) {
      double sum = 0;
      for (int j = 0; j < p; ++j) {
        double l = 1;
        for (int m = 0; m < p; ++m)
          if (m != j) l *= double(-k - m) / double(j - m);
        sum += l * a[j];
      }
      a[-k] = sum;
    }
  }
  double first(const double* a) const {
    if (reach_ == 2) return (8 * (a[1] - a[-1]) - (a[2] - a[-2])) / 12;
    return (45 * (a[1] - a[-1]) - 9 * (a[2] - a[-2]) + (a[3] - a[-3])) / 60;
  }
  double second(const double* a) const {
    if (reach_ == 2) return (16 * (a[1] + a[-1]) - (a[2] + a[-2]) - 30 * a[0]) / 12;
    return (270 * (a[1] + a[-1]) - 27 * (a[2] + a[-2]) + 2 * (a[3] + a[-3]) - 490 * a[0]) / 180;
  }

  Field x, w;  // of the nodes; s is their number, so that its spacing is 1
  const Scene scene_;
  const int n_, reach_;
};

// Rates at time `after` within a step that began with the map grid.x.
void rates(Grid& g, State& u, double after, bool moves, State& rate, Field& place) {
  const Scene& s = g.scene_;
  g.extend(u.psi, 0);
  const double c2 = s.c * s.c / s.gamma, uniform = 1 / (g.h() * g.h());
  const double* p = u.psi.data() + halo;
  const double* e = u.eta.data() + halo;
  double *rp = rate.psi.data() + halo, *re = rate.eta.data() + halo;
  if (!moves) {
    for (int i = 0; i < g.n_; ++i) {
      const double force = e[i] - phi(p[i]);
      rp[i] = s.gamma * force;
      re[i] = (s.v - p[i]) / s.gamma + c2 * uniform * g.second(p + i) - s.delta * force;
    }
  } else {
    g.extend(u.eta, 0);
    for (std::size_t i = 0; i < place.size(); ++i) place[i] = g.x[i] + after * g.w[i];
    g.extend(place, s.length);
    const double* x = place.data() + halo;
    const double* w = g.w.data() + halo;
    for (int i = 0; i < g.n_; ++i) {
      const double over = 1 / g.first(x + i), ps = g.first(p + i) * over;
      const double force = e[i] - phi(p[i]);
      rp[i] = s.gamma * force + w[i] * ps;
      re[i] = (s.v - p[i]) / s.gamma + c2 * over * over * (g.second(p + i) - g.second(x + i) * ps) -
              s.delta * force + w[i] * g.first(e + i) * over;
    }
  }
  if (!s.ring) rp[0] = re[0] = 0;
}

struct Monitor {
  double beta, power;
  int reach;
  double relax;
};

void smooth(Field& m, int n, int reach, bool ring) {
  const double q = std::exp(-1.0 / reach);
  for (int pass = 0; pass < 2; ++pass) {
    double carry = m[0];
    if (ring)
      for (int i = n - std::min(n, 8 * reach); i < n; ++i) carry = q * carry + (1 - q) * m[std::size_t(i)];
    for (int i = 0; i < n; ++i) m[std::size_t(i)] = carry = q * carry + (1 - q) * m[std::size_t(i)];
    carry = m[std::size_t(n - 1)];
    if (ring)
      for (int i = std::min(n, 8 * reach) - 1; i >= 0; --i) carry = q * carry + (1 - q) * m[std::size_t(i)];
    for (int i = n - 1; i >= 0; --i) m[std::size_t(i)] = carry = q * carry + (1 - q) * m[std::size_t(i)];
  }
}

// Where the monitor wants the nodes.
Field wanted(Grid& g, State& u, const Monitor& how) {
  const Scene& s = g.scene_;
  const int n = g.n_;
  g.extend(u.psi, 0);
  g.extend(u.eta, 0);
  g.extend(g.x, s.length);
  const double* x = g.x.data() + halo;
  Field m(static_cast<std::size_t>(n)), xs(m.size());
  double total = 0;
  for (int i = 0; i < n; ++i) {
    const std::size_t k = std::size_t(i);
    xs[k] = g.first(x + i);
    const double a = g.first(u.psi.data() + halo + i) / xs[k], b = g.first(u.eta.data() + halo + i) / xs[k];
    m[k] = std::pow(a * a + b * b, how.power / 2);
    total += m[k] * xs[k];
  }
  const double mean = std::max(total / s.length, 1e-12);
  for (double& value : m) value = 1 - how.beta + how.beta * value / mean;
  smooth(m, n, how.reach, s.ring);
  const int cells = s.ring ? n : n - 1;
  Field sum(std::size_t(cells + 1), 0.0);  // of the monitor from node 0
  for (int i = 0; i < cells; ++i) {
    const std::size_t k = std::size_t(i), next = std::size_t((i + 1) % n);
    sum[k + 1] = sum[k] + 0.5 * (m[k] + m[next]) * (x[i + 1] - x[i]);
  }
  const double whole = sum.back();
  double shift = 0;  // of the whole ring, so that nodes move least
  if (s.ring) {
    for (int i = 0; i < n; ++i) shift += sum[std::size_t(i)] / whole * n - i;
    shift /= n;
  }
  Field result(std::size_t(n), 0.0);
  long j = 0;
  for (int i = 0; i < n; ++i) {
    double target = (i + shift) / cells * whole;
    const double round = std::floor(target / whole);
    double base = 0;
    if (s.ring) {
      base = round * s.length;
      target -= round * whole;
    }
    if (target < sum[std::size_t(j)]) j = 0;
    while (j + 1 < cells && sum[std::size_t(j + 1)] < target) ++j;
    const double a = sum[std::size_t(j)], b = sum[std::size_t(j + 1)], part = (target - a) / (b - a);
    const double da = (x[j + 1] - x[j]);
    // Monotone cubic by the slopes dx/dI = 1/M at both nodes.
    const double ma = (b - a) / m[std::size_t(j)], mb = (b - a) / m[std::size_t((j + 1) % n)];
    const double y = part, y2 = y * y, y3 = y2 * y;
    result[std::size_t(i)] = base + x[j] + da * (3 * y2 - 2 * y3) + ma * (y - 2 * y2 + y3) + mb * (y3 - y2);
  }
  if (!s.ring) {
    result[0] = 0;
    result[std::size_t(n - 1)] = s.length;
  }
  return result;
}

// Velocities of the nodes for the next step: towards where the monitor wants them, within `relax` steps, but
// in no less time than a signal takes over `relax`/4 of the smallest spacing, since short steps would else
// throw the nodes about.
void follow(Grid& g, State& u, const Monitor& how, double dt) {
  const Field to = wanted(g, u, how);
  double least = 1e300;
  for (int i = halo; i < g.n_ + halo - 1; ++i)
    least = std::min(least, g.x[std::size_t(i + 1)] - g.x[std::size_t(i)]);
  const double lag = how.relax * std::max(dt, 0.25 * least / g.scene_.c);
  for (int i = 0; i < g.n_; ++i)
    g.w[std::size_t(i + halo)] = (to[std::size_t(i)] - g.x[std::size_t(i + halo)]) / lag;
  g.extend(g.w, 0);
  if (!g.scene_.ring) g.w[halo] = 0;
}

struct Tableau {
  static constexpr int stages = 7;
  static constexpr double c[7] = {0, 0.2, 0.3, 0.8, 8.0 / 9, 1, 1};
  static constexpr double a[7][6] = {
      {},
      {1.0 / 5},
      {3.0 / 40, 9.0 / 40},
      {44.0 / 45, -56.0 / 15, 32.0 / 9},
      {19372.0 / 6561, -25360.0 / 2187, 64448.0 / 6561, -212.0 / 729},
      {9017.0 / 3168, -355.0 / 33, 46732.0 / 5247, 49.0 / 176, -5103.0 / 18656},
      {35.0 / 384, 0, 500.0 / 1113, 125.0 / 192, -2187.0 / 6784, 11.0 / 84}};
  static constexpr double e[7] = {71.0 / 57600,      0,          -71.0 / 16695, 71.0 / 1920,
                                  -17253.0 / 339200, 22.0 / 525, -1.0 / 40};
};

struct Result {
  long steps = 0, rejected = 0;
  double seconds = 0, thinnest = 1e300;
};

double processor_seconds() { return double(std::clock()) / CLOCKS_PER_SEC; }

Result integrate(Grid& g, State& u, double end, const Monitor& how, double tolerance) {
  const bool moves = how.beta > 0;
  Result result;
  std::array<State, 7> k;
  for (State& s : k) s = {Field(u.psi.size(), 0.0), Field(u.psi.size(), 0.0)};
  State stage = u;
  Field place = g.x;
  double t = 0, dt = 1e-3 * g.h() / g.scene_.c;
  const double begin = processor_seconds();
  while (t < end * (1 - 1e-14)) {
    dt = std::min(dt, end - t);
    if (moves) follow(g, u, how, dt);
    for (int j = 0; j < 7; ++j) {
      stage = u;
      for (int l = 0; l < j; ++l) {
        const double f = dt * Tableau::a[j][l];
        if (f == 0) continue;
        for (int i = halo; i < g.n_ + halo; ++i) {
          stage.psi[std::size_t(i)] += f * k[std::size_t(l)].psi[std::size_t(i)];
          stage.eta[std::size_t(i)] += f * k[std::size_t(l)].eta[std::size_t(i)];
        }
      }
      rates(g, stage, Tableau::c[j] * dt, moves, k[std::size_t(j)], place);
    }
    double error = 0;
    for (int i = halo; i < g.n_ + halo; ++i) {
      const std::size_t q = std::size_t(i);
      double a = 0, b = 0;
      for (int j = 0; j < 7; ++j) {
        a += Tableau::e[j] * k[std::size_t(j)].psi[q];
        b += Tableau::e[j] * k[std::size_t(j)].eta[q];
      }
      a *= dt / (tolerance * (1 + std::abs(u.psi[q])));
      b *= dt / (tolerance * (1 + std::abs(u.eta[q])));
      error += a * a + b * b;
    }
    error = std::sqrt(error / (2 * g.n_));
    const double factor = std::clamp(0.9 * std::pow(std::max(error, 1e-10), -0.2), 0.2, 3.0);
    if (!(error < 1)) {
      ++result.rejected;
      if (result.rejected > 100000 || !(dt > 1e-13)) throw std::runtime_error("no step is accepted");
      dt *= std::isfinite(error) ? factor : 0.2;
      continue;
    }
    for (std::size_t i = halo; i < std::size_t(g.n_ + halo); ++i) {
      u.psi[i] = stage.psi[i];
      u.eta[i] = stage.eta[i];
      g.x[i] += dt * g.w[i];
    }
    t += dt;
    ++result.steps;
    dt *= factor;
  }
  result.seconds = processor_seconds() - begin;
  for (int i = halo; i < g.n_ + halo - 1; ++i)
    result.thinnest = std::min(result.thinnest, g.x[std::size_t(i + 1)] - g.x[std::size_t(i)]);
  return result;
}

// Values at even places, by polynomials of degree 7 through the nearest nodes in x.
Field sampled(Grid& g, Field& f, int places) {
  g.extend(g.x, g.scene_.length);
  g.extend(f, 0);
  const double* x = g.x.data() + halo;
  const double* a = f.data() + halo;
  Field result;
  int j = 0;
  for (int i = 0; i < places; ++i) {
    double at = g.scene_.length * i / (places - 1);
    if (g.scene_.ring) {
      while (at < x[0]) at += g.scene_.length;
      while (at >= x[0] + g.scene_.length) at -= g.scene_.length;
      if (at < x[j]) j = 0;
    }
    while (j + 1 < g.n_ - (g.scene_.ring ? 0 : 1) && x[j + 1] <= at) ++j;
    const int last = g.scene_.ring ? g.n_ - 1 + halo : g.n_ - 1 + 3;
    const int first = std::clamp(j - 3, g.scene_.ring ? -halo : 0, last - 7);
    double sum = 0;
    for (int k = first; k < first + 8; ++k) {
      double l = a[k];
      for (int m = first; m < first + 8; ++m)
        if (m != k) l *= (at - x[m]) / (x[k] - x[m]);
      sum += l;
    }
    result.push_back(sum);
  }
  return result;
}

// The limit cycle of f' = gamma (e - phi(f))..., as a train f(t - x/V): f'' (1 - c2/V2) + gamma (f2 - 1) f' +
// f - v = 0.
struct Train {
  double period;
  Field f, df;  // at even phases
};

Train limit_cycle(const Scene& s, double speed) {
  const double mass = 1 - s.c * s.c / (speed * speed);
  auto rate = [&](double f, double d, double& rf, double& rd) {
    rf = d;
    rd = -((s.gamma * (f * f - 1) + s.delta) * d + f - s.v) / mass;
  };
  auto step = [&](double& f, double& d, double h) {
    double k[4][2];
    rate(f, d, k[0][0], k[0][1]);
    rate(f + h / 2 * k[0][0], d + h / 2 * k[0][1], k[1][0], k[1][1]);
    rate(f + h / 2 * k[1][0], d + h / 2 * k[1][1], k[2][0], k[2][1]);
    rate(f + h * k[2][0], d + h * k[2][1], k[3][0], k[3][1]);
    f += h / 6 * (k[0][0] + 2 * k[1][0] + 2 * k[2][0] + k[3][0]);
    d += h / 6 * (k[0][1] + 2 * k[1][1] + 2 * k[2][1] + k[3][1]);
  };
  const double h = 2e-4 * std::sqrt(mass);
  double f = s.v + 1, d = 0, t = 0, crossed = -1, period = 0;
  double f0 = 0, d0 = 0;
  while (period == 0) {
    double fn = f, dn = d;
    step(fn, dn, h);
    if (t > 60 && f < s.v && fn >= s.v) {
      const double part = h * (s.v - f) / (fn - f);
      double fp = f, dp = d;
      step(fp, dp, part);
      if (crossed < 0) {
        crossed = t + part;
        f0 = fp, d0 = dp;
      } else {
        period = t + part - crossed;
      }
    }
    f = fn, d = dn, t += h;
  }
  Train train{period, {}, {}};
  const int places = int(period / h) + 1;
  f = f0, d = d0;
  for (int i = 0; i <= places; ++i) {
    train.f.push_back(f);
    train.df.push_back(d);
    step(f, d, period / places);
  }
  return train;
}

double at_phase(const Field& f, double phase) {
  phase -= std::floor(phase);
  const int n = int(f.size()) - 1;
  const double y = phase * n;
  const int first = std::clamp(int(y) - 1, 0, n - 3);
  double sum = 0;
  for (int k = first; k < first + 4; ++k) {
    double l = f[std::size_t(k)];
    for (int m = first; m < first + 4; ++m)
      if (m != k) l *= (y - m) / (k - m);
    sum += l;
  }
  return sum;
}

}  // namespace

int main(int argc, char** argv) {
  std::map<std::string, std::string> o{{"n", "512"},    {"order", "6"},    {"beta", "0"},   {"power", "0.5"},
                                       {"reach", "8"},  {"relax", "10"},   {"tol", "1e-6"}, {"out", ""},
                                       {"against", ""}, {"speed", "1.02"}, {"warm", "20"},  {"end", ""}};
  const std::string name = argc > 1 ? argv[1] : "pacemaker";
  for (int i = 2; i < argc; ++i) {
    const std::string a = argv[i];
    o[a.substr(0, a.find('='))] = a.substr(a.find('=') + 1);
  }
  Scene s;
  Train train{};
  const double speed = std::stod(o["speed"]);
  if (name == "pacemaker")
    s = {3, 0.2, 1, 0.2, 60, 5, false, -1.5};
  else if (name == "stiff")
    s = {30, 0, 1, 0.2, 60, 30, true, 0};
  else if (name == "ring")
    s = {3, 0, 1, 0.2, 60, 20, true, 0};
  else if (name == "train") {
    s = {3, 0, 1, 0.5, 0, 5, true, 0};
    train = limit_cycle(s, speed);
    s.length = speed * train.period;
  }
  if (!o["end"].empty()) s.end = std::stod(o["end"]);
  Grid g(s, std::stoi(o["n"]), std::stoi(o["order"]));
  State u{Field(g.x.size(), 0.0), Field(g.x.size(), 0.0)};
  auto fill = [&] {
    for (int i = 0; i < g.n_; ++i) {
      const std::size_t k = std::size_t(i + halo);
      const double x = g.x[k];
      if (name == "ring" || name == "stiff") {
        u.psi[k] = 0.1 + 0.5 * std::sin(2 * M_PI * x / s.length);
        u.eta[k] = 0.1;
      } else if (name == "train") {
        u.psi[k] = at_phase(train.f, -x / s.length);
        u.eta[k] = at_phase(train.df, -x / s.length) / s.gamma + phi(u.psi[k]);
      } else {
        const double r = x / 2;
        u.psi[k] = 0.1 + (s.held - 0.1) * std::exp(-r * r);
        u.eta[k] = phi(u.psi[k]);
      }
    }
  };
  fill();
  const Monitor how{std::stod(o["beta"]), std::stod(o["power"]), std::stoi(o["reach"]),
                    std::stod(o["relax"])};
  if (how.beta > 0) {
    for (int round = 0; round < std::stoi(o["warm"]); ++round) {
      const Field to = wanted(g, u, how);
      for (int i = 0; i < g.n_; ++i)
        g.x[std::size_t(i + halo)] += 0.3 * (to[std::size_t(i)] - g.x[std::size_t(i + halo)]);
      fill();
    }
  }
  const Result r = integrate(g, u, s.end, how, std::stod(o["tol"]));
  const int places = 20001;
  const Field psi = sampled(g, u.psi, places), eta = sampled(g, u.eta, places);
  double ep = 0, ee = 0, square = 0;
  auto differ = [&](int i, double f, double e) {
    const double a = std::abs(psi[std::size_t(i)] - f), b = std::abs(eta[std::size_t(i)] - e);
    ep = std::max(ep, a);
    ee = std::max(ee, b);
    square += (a * a + b * b) / (2 * places);
  };
  if (name == "train") {
    for (int i = 0; i < places; ++i) {
      const double phase = (s.end - s.length * i / (places - 1) / speed) / train.period;
      const double f = at_phase(train.f, phase), e = at_phase(train.df, phase) / s.gamma + phi(f);
      differ(i, f, e);
    }
  } else if (!o["against"].empty()) {
    std::ifstream file(o["against"]);
    for (int i = 0; i < places; ++i) {
      double a, b;
      file >> a >> b;
      differ(i, a, b);
    }
  }
  if (!o["out"].empty()) {
    std::FILE* file = std::fopen(o["out"].c_str(), "w");
    for (int i = 0; i < places; ++i)
      std::fprintf(file, "%.17g %.17g\n", psi[std::size_t(i)], eta[std::size_t(i)]);
    std::fclose(file);
  }
  std::printf(
      "%s n %s order %s beta %s tol %s: steps %ld rejected %ld seconds %.3f h_min %.3g error %.3g %.3g rms "
      "%.3g\n",
      name.c_str(), o["n"].c_str(), o["order"].c_str(), o["beta"].c_str(), o["tol"].c_str(), r.steps,
      r.rejected, r.seconds, r.thinnest, ep, ee, std::sqrt(square));
  return 0;
}
