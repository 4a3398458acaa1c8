#include "stickslip/accuracy.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "stickslip/error.hpp"
#include "stickslip/methods.hpp"
#include "stickslip/probe.hpp"
#include "stickslip/start.hpp"
#include "stickslip/time.hpp"

namespace stickslip {

namespace {

constexpr double share_of_time = 0.15;   // of the accuracy: meant for the error in time,
constexpr double share_of_space = 0.4;   // and for that in space; the rest is for what was foreseen wrongly
constexpr double most_seconds = 300;     // of processor time for one run
constexpr PetscInt most_nodes = 1 << 20;

Fields at_points(const Fields& fields, const Scene& scene, const std::vector<double>& x) {
  Fields result;
  for (const double at : x) {
    double psi = 0, eta = 0;
    for (const auto& [node, weight] : interpolation_at(scene, at)) {
      psi += weight * fields.psi[std::size_t(node)];
      eta += weight * fields.eta[std::size_t(node)];
    }
    result.psi.push_back(psi);
    result.eta.push_back(eta);
  }
  return result;
}

std::string rounded(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.2g", value);
  return text;
}

bool is_uniform(const Options& options, const Scene& scene) {
  return scene.spread == 0 && options.text("init_type") == "uniform" && scene.left != End::velocity &&
         scene.right != End::velocity && options.real("init_noise") == 0;
}

}  // namespace

double expected_order(double earlier, double last, int p) {
  last = std::clamp(last, 0.5, double(p));
  const bool rising = !std::isnan(earlier) && last > earlier + 0.3;
  return rising || last > 0.8 * p ? (last + p) / 2 : last;
}

AccuracyPlan::AccuracyPlan(const Options& options, double wanted)
    : asked_(options),
      chosen_(options),
      wanted_(wanted),
      aim_(wanted),
      most_tolerance_(std::min(3 * wanted, 1e-3)),
      scene_(Scene::from(options, false)),
      probes_(options.reals("out_probes")) {
  const double begin = largest_processor_seconds();
  if (has_threshold(scene_.friction.law) && !scene_.friction.regularised)
    throw UsageError("accuracy " + options.text("accuracy") +
                     " with friction_stick exact: there is one method for exact "
                     "stick; set ts_rtol and ts_atol, or friction_stick regularised");
  const bool continuum = has_grid_limit(options, scene_) && !is_uniform(options, scene_);
  grid_open_ = continuum && !options.is_set("grid_n");
  order_open_ = continuum && !options.is_set("grid_order");
  has_space_ = continuum;
  method_open_ = !options.is_set("ts_type");
  tolerance_open_ = !options.is_set("ts_rtol") && !options.is_set("ts_atol");
  for (const Method& m : methods())
    if (const std::string name = subtype_option(m.type); method_open_ && !name.empty() && options.is_set(name))
      throw UsageError("-" + name + " " + options.text(name) + " with -accuracy: set ts_type as well");
  if (options.is_set("ts_adapt_type"))
    throw UsageError("-ts_adapt_type " + options.text("ts_adapt_type") + ": with -accuracy steps follow the error "
                     "estimate of the method; leave it out");
  if (!method_open_) {
    const std::string type = options.text("ts_type"), sub = subtype_option(type);
    std::string text = type;
    if (!sub.empty() && options.is_set(sub)) text += ":" + options.text(sub);
    setting_.method = MethodChoice::parse("ts_type", text);
    if (!setting_.method.has_estimate())
      throw UsageError("-ts_type " + text +
                       ": it has no error estimate, which -accuracy needs; use rk, arkimex or rosw");
    if (options.is_set("imex_implicit")) setting_.method.implicit = options.text("imex_implicit");
  } else {
    setting_.method = MethodChoice::parse("accuracy", wanted_ <= 1e-5 ? "rk:8vr" : "rk:5dp");
  }
  if (!tolerance_open_)
    setting_.tolerance = std::min(options.is_set("ts_rtol") ? options.real("ts_rtol") : 1.,
                                  options.is_set("ts_atol") ? options.real("ts_atol") : 1.);
  setting_.order = order_open_ ? possible_orders(scene_).back() : scene_.order;
  setting_.n = scene_.n;

  if (has_space_) {
    climb();
  } else {
    choose_method_and_tolerance(scene_.n);
  }
  seconds_ = largest_processor_seconds() - begin;
  finish(why_);
}

Trial AccuracyPlan::trial(const MethodChoice& method, double tolerance, int order, PetscInt n, double limit) {
  return run_trial(asked_, {method, tolerance, 0, order, n}, "", limit);
}

// Whether the program itself would take something implicitly at the start.
bool AccuracyPlan::starts_stiff(PetscInt n) const {
  std::vector<std::string> unheard;
  const WarningsKept kept(unheard);
  const Options options = options_for(asked_, {MethodChoice::parse("accuracy", "arkimex:4"), 0, 0, setting_.order, n});
  const Model model(PETSC_COMM_WORLD, Scene::from(options, false));
  VecHandle u = model.create_vector();
  set_start(model, options, u);
  return Integrator(model, options, u, "reference_").report().implicit != Implicit::none;
}

// On a grid of n nodes: three tolerances, of which the strictest is meant to be what is needed there.
void AccuracyPlan::choose_method_and_tolerance(PetscInt n) {
  const auto scene_at = [&] {
    return Scene::from(options_for(asked_, {setting_.method, 0, 0, setting_.order, n}), false);
  };
  const Scene scene = scene_at();
  const double target = share_of_time * (has_space_ ? 1 : 2) * aim_;

  struct Known {
    MethodChoice method;
    double tolerance, error, slope, seconds;
    long evaluations;
    Fields end;
  };
  // Looser and looser tolerances until three answers show a rate.
  const auto study = [&](const MethodChoice& method, double first, double limit) -> std::optional<Known> {
    constexpr double factor = 20;
    const Trial loose = trial(method, std::min(first * factor, 0.1), setting_.order, n, limit);
    if (!loose.failed.empty()) return std::nullopt;
    double tolerance = std::min(first * factor, 0.1) / factor;
    Fields before = loose.end;
    double last_difference = NAN, seconds = loose.seconds;
    PetscInt steps = loose.steps;
    for (int round = 0; round < 12; ++round) {
      const Trial now = trial(method, tolerance, setting_.order, n, limit);
      if (!now.failed.empty()) return std::nullopt;
      const double d = difference({scene, before}, {scene, now.end});
      // d is about the error at the looser tolerance
      const double slope =
          std::isnan(last_difference) ? 1 : std::log(last_difference / std::max(d, 1e-300)) / std::log(factor);
      const double used = std::clamp(slope, 0.4, 0.9);
      seconds = now.seconds;
      const double error = d / (std::pow(factor, used) - 1);
      // the same steps at both tolerances (a short run, in which they only grow): the difference tells nothing
      const bool telling = now.steps > steps || !tolerance_open_ || tolerance < 2e-14;
      steps = now.steps;
      if ((telling && error <= target) || !tolerance_open_ || tolerance < 2e-14)
        return Known{method, tolerance, std::max(error, 1e-15), used, seconds, now.rhs_evaluations, now.end};
      last_difference = d;
      before = now.end;
      tolerance /= factor;
    }
    return std::nullopt;
  };

  const double first = tolerance_open_ ? std::clamp(0.3 * target, 1e-13, 1e-2) : setting_.tolerance;
  const bool stiff = method_open_ && starts_stiff(n);
  if (stiff) setting_.method = MethodChoice::parse("accuracy", "rosw:ra34pw2");
  std::optional<Known> best = study(setting_.method, first, most_seconds);
  if (!best && !method_open_)
    throw Failure("accuracy " + rounded(wanted_) + ": " + setting_.method.name() + " failed on the way to it");
  if (method_open_) {
    // Others may be cheaper where an explicit method's steps are those of stability, which no looser tolerance
    // lengthens.
    std::vector<const char*> others;
    if (!best || stiff) {
      others = {"rk:3bs", "arkimex:4:both"};
    } else if (best->seconds > 3e-3) {
      const Trial looser = trial(best->method, std::min(best->tolerance * 1000, 1e-1), setting_.order, n, most_seconds);
      if (!looser.failed.empty() || double(looser.rhs_evaluations) > 0.6 * double(best->evaluations))
        others = {"rk:3bs", "rosw:ra34pw2", "arkimex:4:both"};
    }
    for (const char* name : others) {
      const auto other = study(MethodChoice::parse("accuracy", name), first, best ? 1.5 * best->seconds : most_seconds);
      if (!other) continue;
      const auto at_target = [&](const Known& k) {  // what it costs at the same error, by its order
        return k.seconds * std::pow(k.error / target, 1. / k.method.order());
      };
      if (best && at_target(*other) > 0.7 * at_target(*best)) continue;
      best = other;
    }
    if (best && best->method.name() != "rk:5dp" && best->method.name() != "rk:8vr")
      why_ = best->method.is_explicit() ? "steps are bound by stability, the cheapest stages win"
                                        : "explicit steps would be bound by stability";
    if (!best) throw Failure("accuracy " + rounded(wanted_) + ": no method got to ts_max_time on a grid of " +
                             std::to_string(n) + " nodes");
  }
  setting_.method = best->method;
  tolerance_ref_ = best->tolerance;
  error_ref_ = best->error;
  slope_ = best->slope;
  if (error_ref_ > wanted_)
    throw Failure("accuracy " + rounded(wanted_) + " is out of reach: at tolerance " + rounded(tolerance_ref_) +
                  " the error in time is still about " + rounded(error_ref_) +
                  (tolerance_open_ ? " (the motion amplifies what is lost)" : " (ts_rtol, ts_atol as set)"));
  if (tolerance_open_) {
    // where the error is far below what is wanted, a looser tolerance
    const double looser = std::pow(target / error_ref_, 1 / slope_);
    setting_.tolerance = std::min(tolerance_ref_ * std::min(std::max(looser, 1.), 1000.), most_tolerance_);
  }
  if (!has_space_) coarse_ = {scene, best->end};
}

double AccuracyPlan::difference(const Rung& a, const Rung& b) const {
  const bool a_coarser = a.scene.n <= b.scene.n;
  const Rung &coarse = a_coarser ? a : b, &fine = a_coarser ? b : a;
  return std::max(
      distance(coarse.fields, resample(fine.fields, fine.scene, coarse.scene)),
      distance(at_points(coarse.fields, coarse.scene, probes_), at_points(fine.fields, fine.scene, probes_)));
}

void AccuracyPlan::climb() {
  const int p = setting_.order;
  const auto finer = [&](PetscInt n) { return scene_.ring() ? 2 * n : 2 * (n - 1) + 1; };
  std::vector<PetscInt> grids;
  if (grid_open_) {
    PetscInt n = scene_.ring() ? 12 : 13;
    // no coarser than the medium and the start: a spread needs two nodes a draw, a sine eight a wave
    const double shortest = std::min(scene_.spread > 0 ? 4 * scene_.spread_length : scene_.length,
                                     asked_.text("init_type") == "sine"
                                         ? scene_.length / double(std::max<PetscInt>(1, asked_.integer("init_mode")))
                                         : scene_.length);
    while (scene_.length / double(n) > shortest / 8 && n < most_nodes) n = finer(n);
    grids = {n};
  } else {
    const PetscInt cells = scene_.ring() ? scene_.n : scene_.n - 1, rest = scene_.ring() ? 0 : 1;
    for (const PetscInt part : {4, 2})
      if (cells / part + rest >= p + 1) grids.push_back(cells / part + rest);
    if (grids.empty()) grids.push_back(scene_.n);
  }
  // Grids are compared at a tolerance far below the one that the run will have; where their differences do not fall and
  // are those of the steps in time, it was not far enough.
  constexpr double below = 20;
  const auto rung_at = [&](PetscInt n, double tolerance) {
    const Setting s{setting_.method, tolerance, 0, p, n};
    const Trial now = trial(s.method, s.tolerance, p, n, most_seconds);
    if (!now.failed.empty())
      throw Failure("accuracy " + rounded(wanted_) + ": on " + std::to_string(n) + " nodes: " + now.failed);
    last_seconds_ = now.seconds;
    last_steps_ = now.steps;
    return Rung{Scene::from(options_for(asked_, s), false), now.end};
  };
  const auto tight = [&] { return tolerance_open_ ? std::max(setting_.tolerance / below, 1e-14) : setting_.tolerance; };
  // What the run's tolerance costs in error on this grid; noise of the shortest waves grows with their frequency.
  const auto error_in_time = [&](const Rung& rung, double stretch) {
    if (!tolerance_open_) return error_ref_ * stretch;
    const PetscInt steps = last_steps_;
    const Rung loose = rung_at(rung.scene.n, setting_.tolerance);
    // the same steps at both tolerances: the difference tells nothing
    if (last_steps_ >= steps)
      return stretch * difference(loose, rung_at(rung.scene.n, std::max(tight() / 1000, 1e-14)));
    return stretch * difference(rung, loose);
  };
  double last = NAN, rate_before = NAN, rate = NAN;
  int restarts = 0;
  for (std::size_t k = 0;; ++k) {
    if (k == grids.size()) grids.push_back(finer(grids.back()));
    const PetscInt n = grids[k];
    if (restarts == 0 && (k == 0 || (k == 2 && grid_open_))) choose_method_and_tolerance(n);
    Rung rung = rung_at(n, tight());
    if (k > 0) {
      const double before = last;
      last = difference(coarse_, rung);
      rate_before = rate;
      rate = std::log2(before / last);
    }
    const bool is_last = !grid_open_ && k + 1 == grids.size();
    if (!is_last && (k < 2 || !grid_open_)) {
      coarse_ = std::move(rung);
      continue;
    }
    // suspicious: the steps in time may be what the differences show
    if (tolerance_open_ && rate < 0.5 * p && last > 0.1 * wanted_ && tight() > 2e-14 &&
        error_in_time(rung, 1) > 0.5 * last && restarts < 6) {
      ++restarts;
      setting_.tolerance = std::max(setting_.tolerance / 10, 1e-14);
      last = rate_before = rate = NAN;
      const std::size_t back = std::min<std::size_t>(k, 2);
      grids.erase(grids.begin(), grids.begin() + std::ptrdiff_t(k - back));
      k = std::size_t(-1);
      continue;
    }
    order_seen_ = expected_order(rate_before, std::isnan(rate) ? p / 2. : rate, p);
    space_error_ =
        std::isnan(last) ? NAN : last / (std::pow(2, std::clamp(std::isnan(rate) ? p / 2. : rate, 0.5, double(p))) - 1);
    const double factor = std::pow(space_error_ / (share_of_space * aim_), 1 / order_seen_);
    if (grid_open_) {
      const bool hopeless =
          n > 2000 && (double(n) * factor > double(most_nodes) || last_seconds_ * factor * factor > most_seconds);
      if (hopeless || finer(n) > most_nodes)
        throw Failure("accuracy " + rounded(wanted_) + " is out of reach: on " + std::to_string(n) +
                      " nodes the error is about " + rounded(space_error_) + " and falls like h^" + rounded(rate) +
                      (rate < 0.4 * p ? ", which is what jumps and corners leave of order " + std::to_string(p)
                                      : ", as fronts do that are not resolved") +
                      "; best reached " + rounded(space_error_));
      // too coarse still to tell, or to be the last grid before the run
      if (factor > 2.2 || (rate < 1 && space_error_ > wanted_)) {
        coarse_ = std::move(rung);
        continue;
      }
    }
    // a little finer or coarser than the last grid: only then does the run's difference from it tell its error
    double stretch = grid_open_ ? std::max(factor, 0.55) : 2;
    if (stretch > 0.85 && stretch < 1.2) stretch = 1.2;
    double in_time = error_in_time(rung, std::max(1., stretch));
    for (int round = 0; tolerance_open_ && in_time > 0.3 * wanted_; ++round) {
      if (round == 8 || setting_.tolerance < 2e-14)
        throw Failure("accuracy " + rounded(wanted_) + " is out of reach: at tolerance " + rounded(setting_.tolerance) +
                      " the error in time is still about " + rounded(in_time) + " (the motion amplifies what is lost)");
      setting_.tolerance =
          std::max(setting_.tolerance * std::clamp(share_of_time * wanted_ / in_time, 0.03, 0.3), 1e-14);
      rung = rung_at(n, tight());
      in_time = error_in_time(rung, std::max(1., stretch));
    }
    tolerance_ref_ = setting_.tolerance;
    error_ref_ = std::max(in_time, 1e-15);
    coarse_ = std::move(rung);
    if (!grid_open_) {
      setting_.n = scene_.n;
      return;
    }
    PetscInt cells = PetscInt(std::ceil(double(scene_.ring() ? n : n - 1) * stretch));
    cells += cells % 2;
    setting_.n = std::max<PetscInt>(cells + (scene_.ring() ? 0 : 1), p + 2);
    return;
  }
}

void AccuracyPlan::finish(const std::string& why) {
  chosen_ = options_for(asked_, setting_);
  if (!has_space_) chosen_ = asked_.with("imex_implicit", chosen_.text("imex_implicit"));
  const auto set = [&](const std::string& name, const std::string& value) {
    if (!asked_.is_set(name)) chosen_ = chosen_.with(name, value);
  };
  set("ts_type", setting_.method.type);
  if (const std::string sub = subtype_option(setting_.method.type); !sub.empty()) set(sub, setting_.method.subtype);
  set("ts_rtol", number_text(setting_.tolerance));
  set("ts_atol", number_text(setting_.tolerance));
  what_ = setting_.method.name() +
          (setting_.method.splits() ? " (implicit: " + setting_.method.implicit + ")" : "") + ", tolerance " +
          rounded(setting_.tolerance);
  if (has_space_) what_ += ", order " + std::to_string(setting_.order) + ", n = " + std::to_string(setting_.n);
  what_ += "; error in time about " + rounded(error_ref_ * std::pow(setting_.tolerance / tolerance_ref_, slope_));
  if (has_space_ && !std::isnan(space_error_))
    what_ += ", in space " + rounded(space_error_) + " on " + std::to_string(coarse_.scene.n) +
             " nodes, falling like h^" + rounded(order_seen_);
  if (!why.empty()) what_ += "; " + why;
}

double AccuracyPlan::estimate(const Fields& end) const {
  const Rung now{Scene::from(chosen_, false), end};
  const double d = difference(coarse_, now);
  const double in_time = error_ref_ * std::pow(setting_.tolerance / tolerance_ref_, slope_);
  if (!has_space_) {
    // the run against a stricter or equal one, whose own error is error_ref_
    return 1.3 * std::max(d, in_time) + error_ref_;
  }
  const double ratio = coarse_.scene.h() / now.scene.h();
  const double foreseen = space_error_ / std::pow(ratio, order_seen_);
  // d holds the error in time as well
  const double seen = d / (std::pow(ratio, order_seen_) - 1);
  const double in_space = ratio < 0.99      ? d + space_error_
                          : ratio <= 1.01   ? space_error_
                          : d > 3 * in_time ? seen
                                            : std::min(seen, foreseen);
  return 1.5 * in_space + 2 * in_time;
}

void AccuracyPlan::refine(const Fields& end, double estimated) {
  const Rung now{Scene::from(chosen_, false), end};
  const double in_time = error_ref_ * std::pow(setting_.tolerance / tolerance_ref_, slope_);
  const bool space = has_space_ && estimated - 2 * in_time > 0.5 * wanted_;
  if (space && !grid_open_)
    throw Failure("accuracy " + rounded(wanted_) + " is out of reach on grid_n " + std::to_string(setting_.n) +
                  " as set: the error is about " + rounded(estimated));
  if (!tolerance_open_ && !space)
    throw Failure("accuracy " + rounded(wanted_) + " is out of reach at the tolerance " + rounded(setting_.tolerance) +
                  " as set: the error is about " + rounded(estimated));
  most_tolerance_ = std::max(1e-14, setting_.tolerance / 10);
  if (has_space_) {
    aim_ *= 0.3;
    climb();
  } else {
    setting_.tolerance = most_tolerance_;
    if (setting_.tolerance < tolerance_ref_) coarse_ = now;  // the difference is then that run's error
  }
  finish(why_);
}

}  // namespace stickslip
