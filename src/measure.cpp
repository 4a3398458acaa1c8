#include "stickslip/measure.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

namespace stickslip {

namespace {

// Upward passages of psi through `level` along x; a dip counts only where it goes at least `depth` below.
int count_passages(const std::vector<double>& psi, double level, double depth, bool ring) {
  const std::size_t n = psi.size();
  int count = 0;
  bool below = false;
  const std::size_t turns = ring ? 2 * n : n;  // on a ring a first turn finds the state to start with
  for (std::size_t i = 0; i < turns; ++i) {
    const double value = psi[i < n ? i : i - n];
    if (value < level - depth) {
      below = true;
    } else if (value > level + depth && below) {
      below = false;
      if (!ring || i >= n) ++count;
    }
  }
  return count;
}

}  // namespace

Measurement::Measurement(const Scene& scene, double t_end) : scene_(scene), t_end_(t_end) {
  const int last = 4 * quarter;
  for (int i = 0; i < quarter; ++i) times_.push_back(t_end * (0.5 + 0.25 * i / quarter));
  for (int i = 0; i < last; ++i) times_.push_back(t_end * (0.75 + 0.25 * i / last));
  times_.push_back(t_end);
}

void Measurement::sample(double t, const std::vector<double>& psi) {
  const std::size_t n = psi.size(), part = t < 0.75 * t_end_ ? 0 : 1;
  if (low_[part].empty()) low_[part] = high_[part] = psi;
  for (std::size_t i = 0; i < n; ++i) {
    low_[part][i] = std::min(low_[part][i], psi[i]);
    high_[part][i] = std::max(high_[part][i], psi[i]);
  }
  if (part == 1) {
    const auto [low, high] = std::minmax_element(psi.begin(), psi.end());
    const double range = *high - *low;
    double step = scene_.ring() ? std::abs(psi[0] - psi[n - 1]) : 0;
    for (std::size_t i = 1; i < n; ++i) step = std::max(step, std::abs(psi[i] - psi[i - 1]));
    if (range > 1e-3 * (1 + std::abs(scene_.v))) steepest_ = std::max(steepest_, step / range);

    if (passed_.empty()) {
      passed_.assign(n, std::numeric_limits<double>::quiet_NaN());
      mode_ = count_passages(psi, scene_.v, 0.05 * range, scene_.ring());
    } else {
      const double before = sample_t_.back();
      for (std::size_t i = 0; i < n; ++i) {
        const double a = last_[i] - scene_.v, b = psi[i] - scene_.v;
        if (a < 0 && b >= 0) passed_[i] = before + (t - before) * a / (a - b);
      }
    }
    if (scene_.ring() && mode_ > 0) {
      double re = 0, im = 0;
      for (std::size_t i = 0; i < n; ++i) {
        const double angle = 2 * M_PI * std::fmod(mode_ * double(i) / double(n), 1.);
        re += psi[i] * std::cos(angle);
        im -= psi[i] * std::sin(angle);
      }
      double phase = std::atan2(im, re);
      if (!phase_.empty()) phase = phase_.back() + std::remainder(phase - phase_.back(), 2 * M_PI);
      phase_t_.push_back(t);
      phase_.push_back(phase);
    }
    sample_t_.push_back(t);
    last_ = psi;
  }
}

void Measurement::widen(int part, const std::vector<double>& low, const std::vector<double>& high) {
  if (low_[part].empty()) {
    low_[part] = low;
    high_[part] = high;
  }
  for (std::size_t i = 0; i < low.size(); ++i) {
    low_[part][i] = std::min(low_[part][i], low[i]);
    high_[part][i] = std::max(high_[part][i], high[i]);
  }
}

std::optional<double> Measurement::ring_speed() const {
  const std::size_t count = phase_.size();
  if (count < 8) return std::nullopt;
  double mean_t = 0, mean = 0;
  for (std::size_t i = 0; i < count; ++i) {
    mean_t += phase_t_[i] / double(count);
    mean += phase_[i] / double(count);
  }
  double tt = 0, tp = 0;
  for (std::size_t i = 0; i < count; ++i) {
    tt += (phase_t_[i] - mean_t) * (phase_t_[i] - mean_t);
    tp += (phase_t_[i] - mean_t) * (phase_[i] - mean);
  }
  const double slope = tp / tt;
  double square = 0;
  for (std::size_t i = 0; i < count; ++i)
    square += std::pow(phase_[i] - mean - slope * (phase_t_[i] - mean_t), 2) / double(count);
  if (!(std::sqrt(square) < 0.3) || slope == 0) return std::nullopt;
  return -slope * scene_.length / (2 * M_PI * mode_);
}

std::optional<double> Measurement::passage_speed() const {
  // The times of passage climb along one pulse and drop by about a period where the next one takes over. A passage is
  // known to a fraction of the sampling interval, so the slope is taken over whole climbs, never node by node.
  const std::size_t n = passed_.size(), from = n / 4, to = n - n / 4;
  if (sample_t_.size() < 2 || to < from + 4) return std::nullopt;
  const double interval = (sample_t_.back() - sample_t_.front()) / double(sample_t_.size() - 1), h = scene_.h();
  std::vector<double> slowness;
  for (std::size_t i = from; i + 1 < to; ++i) {
    const double s = (passed_[i + 1] - passed_[i]) / h;
    if (std::isfinite(s)) slowness.push_back(s);
  }
  if (slowness.size() < (to - from) / 2) return std::nullopt;
  const auto middle = slowness.begin() + static_cast<std::ptrdiff_t>(slowness.size() / 2);
  std::nth_element(slowness.begin(), middle, slowness.end());
  const double largest_climb = 4 * (interval + h * std::abs(*middle));

  // Least squares with one slope for all climbs and a constant for each; `up`, `down`: nodes by the sign of their
  // climb.
  double xx = 0, xt = 0, tt = 0, up = 0, down = 0;
  for (std::size_t begin = from; begin < to;) {
    std::size_t end = begin + 1;
    while (end < to && std::abs(passed_[end] - passed_[end - 1]) < largest_climb) ++end;
    const auto count = double(end - begin);
    double x = 0, t = 0;
    for (std::size_t i = begin; i < end; ++i) {
      x += scene_.x(static_cast<PetscInt>(i)) / count;
      t += passed_[i] / count;
    }
    double own_xx = 0, own_xt = 0, own_tt = 0;
    for (std::size_t i = begin; i < end && count > 4; ++i) {
      const double dx = scene_.x(static_cast<PetscInt>(i)) - x;
      own_xx += dx * dx;
      own_xt += dx * (passed_[i] - t);
      own_tt += (passed_[i] - t) * (passed_[i] - t);
    }
    (own_xt > 0 ? up : down) += count > 4 ? count : 0;
    xx += own_xx;
    xt += own_xt;
    tt += own_tt;
    begin = end;
  }
  if (std::max(up, down) < 0.8 * double(to - from) || xt == 0) return std::nullopt;
  // Root mean squares: what is left beside the line, and the line itself.
  if (tt - xt * xt / xx > 0.01 * xt * xt / xx) return std::nullopt;
  return xx / xt;
}

Measurement::Result Measurement::result() const {
  Result r;
  r.window_begin = 0.75 * t_end_;
  r.window_end = t_end_;
  if (low_[1].empty()) return r;
  double amplitude[2] = {0, 0};
  for (int part = 0; part < 2; ++part)
    for (std::size_t i = 0; i < low_[part].size(); ++i)
      amplitude[part] = std::max(amplitude[part], (high_[part][i] - low_[part][i]) / 2);
  r.amplitude = amplitude[1];
  r.steepest = steepest_;
  const double scale = scene_.v != 0 ? std::abs(scene_.v) : 1;
  if (amplitude[1] < 1e-3 * scale) {
    r.regime = "sliding";
  } else if (!low_[0].empty()) {
    const double ratio = amplitude[1] / amplitude[0];
    if (ratio < 0.5 && amplitude[1] < 0.2 * scale) r.regime = "sliding";
    if (ratio > 0.75 && ratio < 1.25 && amplitude[1] > 0.2 * scale) r.regime = "stick-slip";
  }
  const auto [low, high] = std::minmax_element(last_.begin(), last_.end());
  const double range = *high - *low;
  const bool waves = range > 1e-3 * scale;
  r.pulses = waves ? count_passages(last_, scene_.v, 0.05 * range, scene_.ring()) : 0;
  if (waves && *r.pulses > 0) {
    if (!scene_.ring()) r.wave_speed = passage_speed();
    else if (double(*r.pulses) == mode_) r.wave_speed = ring_speed();
  }
  return r;
}

std::map<std::string, std::vector<double>> Measurement::save() const {
  return {{"measure_low_0", low_[0]},   {"measure_high_0", high_[0]}, {"measure_low_1", low_[1]},
          {"measure_high_1", high_[1]}, {"measure_last", last_},      {"measure_passed", passed_},
          {"measure_t", sample_t_},     {"measure_phase_t", phase_t_}, {"measure_phase", phase_},
          {"measure_scalars", {mode_, steepest_}}};
}

void Measurement::restore(const std::map<std::string, std::vector<double>>& saved) {
  const auto take = [&](const char* name, std::vector<double>& into) {
    const auto found = saved.find(name);
    if (found != saved.end()) into = found->second;
  };
  take("measure_low_0", low_[0]);
  take("measure_high_0", high_[0]);
  take("measure_low_1", low_[1]);
  take("measure_high_1", high_[1]);
  take("measure_last", last_);
  take("measure_passed", passed_);
  take("measure_t", sample_t_);
  take("measure_phase_t", phase_t_);
  take("measure_phase", phase_);
  const auto n = static_cast<std::size_t>(scene_.n);
  const auto fits = [n](const std::vector<double>& one, const std::vector<double>& other) {
    return one.size() == other.size() && (one.empty() || one.size() == n);
  };
  if (!fits(low_[0], high_[0]) || !fits(low_[1], high_[1]) || !fits(last_, passed_) ||
      phase_t_.size() != phase_.size() || sample_t_.empty() != last_.empty())
    throw std::runtime_error("its measurements do not fit the scene");
  std::vector<double> scalars;
  take("measure_scalars", scalars);
  if (scalars.size() == 2) {
    mode_ = scalars[0];
    steepest_ = scalars[1];
  }
}

}  // namespace stickslip
