#include "waves/spectral_line.hpp"

#include <algorithm>
#include <cmath>

#include "stickslip/base/error.hpp"
#include "stickslip/numerics/roots.hpp"

namespace stickslip {

namespace {

using Complex = std::complex<double>;
constexpr double spacing = .7;       // of samples, in radians of the slowest wave over a period
constexpr double longest_move = .8;  // of ln rho between samples
constexpr double of_interest = -.3;  // ln |y| from which on multipliers are told apart

}  // namespace

// Most samples that a line takes besides `even` even ones; such as match take some times as many.
double added_samples(double even) { return 1000 + 10 * even; }

Complex apart(Complex a, Complex b) {  // of logarithms
  return {a.real() - b.real(), std::remainder(a.imag() - b.imag(), 2 * M_PI)};
}

// The multiplier nearest to `log_rho`; how near it and the next nearest are.
int nearest(const Multipliers& m, Complex log_rho, double& distance, double& second) {
  int best = 0;
  distance = second = 1e300;
  for (int j = 0; j < m.count; ++j) {
    const double d = std::abs(apart(m.log_rho[j], log_rho));
    if (d < distance) {
      second = distance;
      distance = d;
      best = j;
    } else {
      second = std::min(second, d);
    }
  }
  return best;
}

int nearest(const Multipliers& m, Complex log_rho) {
  double distance, second;
  return nearest(m, log_rho, distance, second);
}

SpectralLine::SpectralLine(Transfer& transfer, double sigma)
    : transfer_(transfer), sigma_(sigma), top_(0), period_(transfer.train().period) {
  const Train& train = transfer.train();
  top_ = transfer.top_frequency(sigma) * std::abs(train.speed) / std::sqrt(train.oscillator->c2());
  double louder = 0;
  closed_ = quiet_beyond(louder);
  if (!closed_ && louder < 3 * top_) {
    top_ = 1.3 * louder;
    closed_ = quiet_beyond(louder);
  }
  if (!closed_) return;  // too far left: no frequency seems high enough
  scan();
  trace_arcs();
}

SpectralLine::Sample SpectralLine::sample(double omega) { return {omega, transfer_.at({sigma_, omega})}; }

double SpectralLine::size(const Sample& s, int j) const { return s.m.log_rho[j].real() - sigma_ * period_; }

bool SpectralLine::quiet_beyond(double& louder) {
  louder = 0;
  for (int k = 1; k <= 24; ++k) {  // an octave with steps that no harmonic follows, then two more
    const double omega = top_ * (k <= 16 ? 1 + (k - .38 * (k % 3)) / 16. : 2 * std::pow(2, (k - 16) / 4.));
    if (size(sample(omega), 0) > 0) louder = omega;
  }
  return louder == 0;
}

bool SpectralLine::matched(const Sample& a, const Sample& b) const {
  for (const auto& [one, other] : {std::pair(&a, &b), std::pair(&b, &a)})
    for (int j = 0; j < one->m.count; ++j) {
      if (size(*one, j) < of_interest) continue;
      double distance, second;
      nearest(other->m, one->m.log_rho[j], distance, second);
      if (distance > longest_move || second < 2 * distance) return false;
    }
  return true;
}

void SpectralLine::scan() {
  const Train& train = transfer_.train();
  const double V = std::abs(train.speed), c = std::sqrt(train.oscillator->c2());
  // ln rho turns at T c/(V + c) in Im lambda for one of the waves, at T c/(V - c) for the other, if that
  // lives at all
  const double decay =
      (sigma_ + transfer_.damping().mean / 2) * train.period * V * (1 + c / V) / (V * train.r2);
  const double rate = train.period * c / V / (decay < 3 ? train.r2 / (1 + c / V) : 1 + c / V);
  const double even = std::min(spacing / rate, top_ / 8);
  // near V = c the multipliers change with lambda over sqrt(r2 |dC/dt|), next to the passages through C = 0
  const double finest = .15 * std::sqrt(train.r2 * transfer_.damping().slope) * V / c;
  // Where multipliers are noise (round-off that fronts have amplified, near V = c) no sampling makes
  // neighbours match.
  double left = added_samples(top_ / even);
  std::vector<Sample> half{sample(0)};
  while (half.back().omega < top_) {
    const double step = std::min(even, std::max(finest, half.back().omega / 4));
    std::vector<Sample> ahead{sample(std::min(top_, half.back().omega + step))};
    while (!ahead.empty()) {
      const double gap = ahead.back().omega - half.back().omega;
      const bool same = matched(half.back(), ahead.back());
      if (same || gap < 1e-10 * top_ || left-- <= 0) {
        closed_ = closed_ && same;
        half.push_back(ahead.back());
        ahead.pop_back();
      } else {
        ahead.push_back(sample(half.back().omega + gap / 2));
      }
    }
  }
  for (size_t k = half.size(); k-- > 1;) {  // the equations are real
    Sample mirrored = half[k];
    mirrored.omega = -mirrored.omega;
    for (Complex& l : mirrored.m.log_rho) l = std::conj(l);
    samples_.push_back(mirrored);
  }
  samples_.insert(samples_.end(), half.begin(), half.end());
}

// Where multiplier i at a, j at b passes the unit circle between them. Phase as of itself alone.
ArcPoint SpectralLine::crossing(const Sample& a, int i, const Sample& b, int j) {
  const Complex from = a.m.log_rho[i], move = apart(b.m.log_rho[j], from);
  Complex found;
  const auto outside = [&](double omega) {
    const Multipliers m = transfer_.at({sigma_, omega});
    found = m.log_rho[nearest(m, from + move * (omega - a.omega) / (b.omega - a.omega))];
    return found.real() - sigma_ * period_;
  };
  const double at = find_root(outside, {a.omega, size(a, i), b.omega, size(b, j)}, 1e-7 / period_);
  outside(at);
  return {at, {0, from.imag() + apart(found, from).imag() - at * period_}};
}

void SpectralLine::trace_arcs() {
  struct Open {
    int root;
    Arc arc;
  };
  std::vector<Open> open;
  const auto point = [&](const Sample& s, int j) {
    return ArcPoint{s.omega, {size(s, j), s.m.log_rho[j].imag() - s.omega * period_}};
  };
  for (int j = 0; j < samples_[0].m.count; ++j)
    if (size(samples_[0], j) > 0) open.push_back({j, {point(samples_[0], j)}});
  for (size_t k = 1; k < samples_.size(); ++k) {
    const Sample &a = samples_[k - 1], &b = samples_[k];
    std::vector<Open> still;
    bool taken[train_max_dim] = {};
    // on along an arc: the phase turns as ln rho does, less the turns of exp(-lambda T), which may be very
    // many
    const auto extend = [&](Arc& arc, ArcPoint p, Complex log_rho, Complex before, double omega_before) {
      const double turn = apart(log_rho, before).imag() - (p.omega - omega_before) * period_;
      p.log_y = {p.log_y.real(), arc.back().log_y.imag() + turn};
      arc.push_back(p);
    };
    for (Open& o : open) {
      const Complex before = a.m.log_rho[o.root];
      const int j = nearest(b.m, before);
      if (size(b, j) > 0 && !taken[j]) {
        taken[j] = true;
        extend(o.arc, point(b, j), b.m.log_rho[j], before, a.omega);
        still.push_back({j, std::move(o.arc)});
      } else {
        const ArcPoint end = crossing(a, o.root, b, j);
        extend(o.arc, end, {0, end.log_y.imag() + end.omega * period_}, before, a.omega);
        arcs_.push_back(std::move(o.arc));
      }
    }
    for (int j = 0; j < b.m.count; ++j) {
      if (taken[j] || size(b, j) <= 0) continue;
      const int i = nearest(a.m, b.m.log_rho[j]);
      const ArcPoint begin = crossing(a, i, b, j);
      Arc arc{begin};
      extend(arc, point(b, j), b.m.log_rho[j], {0, begin.log_y.imag() + begin.omega * period_}, begin.omega);
      still.push_back({j, std::move(arc)});
    }
    open = std::move(still);
  }
  for (Open& o : open) {
    arcs_.push_back(std::move(o.arc));
    closed_ = false;
  }
}

ModeRange modes_between(double first, double last, PetscInt pulses) {
  const double per = double(pulses) / (2 * M_PI);
  return {(long long)std::ceil(last * per), (long long)std::floor(first * per)};
}

ModeRange modes_of(const Arc& arc, PetscInt pulses) {
  return modes_between(arc.front().log_y.imag(), arc.back().log_y.imag(), pulses);
}

long long SpectralLine::count(PetscInt pulses) const {
  long long sum = 0;
  for (const Arc& arc : arcs_) {
    const ModeRange range = modes_of(arc, pulses);
    sum += range.hi - range.lo + 1;
  }
  return sum;
}

long long SpectralLine::count(PetscInt pulses, PetscInt m) const {
  const auto below = [&](long long M) {  // how many of the numbers of class m are <= M, from some start
    const long long shifted = M - m;
    return shifted >= 0 ? shifted / pulses : -((-shifted + pulses - 1) / pulses);
  };
  long long sum = 0;
  for (const Arc& arc : arcs_) {
    const ModeRange range = modes_of(arc, pulses);
    sum += below(range.hi) - below(range.lo - 1);
  }
  return sum;
}

}  // namespace stickslip
