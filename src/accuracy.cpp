#include "stickslip/accuracy.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

#include "pilot.hpp"
#include "stickslip/error.hpp"
#include "stickslip/friction.hpp"
#include "stickslip/methods.hpp"
#include "stickslip/probe.hpp"
#include "stickslip/reduce.hpp"
#include "stickslip/stick.hpp"

namespace stickslip {

namespace {

// Parts of the accuracy: the error foreseen in space, that in time beside it or where nothing else errs, and what the
// error in time of a rung may be of that in space.
constexpr double share_of_space = 0.35, share_of_time = 0.1, share_in_all = 0.55, share_of_rung = 0.1;
constexpr double telling = 50;         // a rung foresees errors down to this part of its own
constexpr double loosened = 30;        // the tolerance that tells what a tolerance costs, over that of the rung
constexpr double least_tolerance = 1e-14;
constexpr double most_seconds = 300;   // of processor time for one run
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

// Largest |difference| at the nodes of the finer grid: what the nodes of the coarser one miss of a front. By the
// polynomial through up to 12 nodes of the coarse grid, with mirror images at free ends; not near held ones, and not in
// a spread medium, which is not as smooth as that.
double distance_between_nodes(const Scene& coarse, const Fields& of_coarse, const Scene& fine, const Fields& of_fine) {
  const PetscInt n = coarse.n;
  const int count = int(std::min<PetscInt>(12, n / 2 * 2));
  if (n == fine.n || coarse.spread > 0) return 0;
  std::array<double, 12> weights = {1};  // barycentric: binomial coefficients with alternating signs
  for (int k = 1; k < count; ++k) weights[std::size_t(k)] = -weights[std::size_t(k - 1)] * (count - k) / k;
  double largest = 0;
  for (PetscInt i = 0; i < fine.n; ++i) {
    const double at = fine.x(i) / coarse.h();
    const PetscInt first = PetscInt(std::floor(at)) - count / 2 + 1;
    if (std::abs(at - std::round(at)) < 1e-9) continue;  // a node of both
    if ((first < 0 && coarse.left == End::velocity) || (first + count > n && coarse.right == End::velocity)) continue;
    double psi = 0, eta = 0, sum = 0;
    for (int k = 0; k < count; ++k) {
      PetscInt node = first + k;
      if (coarse.ring()) node = (node + n) % n;
      else node = node < 0 ? -node : node >= n ? 2 * (n - 1) - node : node;
      const double weight = weights[std::size_t(k)] / (at - double(first + k));
      psi += weight * of_coarse.psi[std::size_t(node)];
      eta += weight * of_coarse.eta[std::size_t(node)];
      sum += weight;
    }
    largest = std::max({largest, std::abs(psi / sum - of_fine.psi[std::size_t(i)]),
                        std::abs(eta / sum - of_fine.eta[std::size_t(i)])});
  }
  return largest;
}

// eta += sign (B psi + F(psi)). In a spread medium eta is no smoother than the medium; without its friction it is.
void add_friction(Fields& fields, const Scene& scene, double sign) {
  const std::vector<double> amplitude = friction_amplitude(scene, 0, scene.n);
  dispatch_friction(scene.friction, [&](const auto& law) {
    for (std::size_t i = 0; i < fields.psi.size(); ++i)
      fields.eta[i] +=
          sign * (scene.B() * fields.psi[i] + amplitude[i] * law.partials(fields.psi[i], 0).F);
  });
}

// `fine` at the nodes of `coarse`.
Fields brought_to(const Scene& coarse, const Scene& fine, const Fields& of_fine) {
  if (coarse.spread == 0 || coarse.friction.state != StateLaw::none) return resample(of_fine, fine, coarse);
  Fields smooth = of_fine;
  add_friction(smooth, fine, -1);
  smooth = resample(smooth, fine, coarse);
  add_friction(smooth, coarse, 1);
  return smooth;
}

bool is_uniform(const Options& options, const Scene& scene) {
  return scene.spread == 0 && options.text("init_type") == "uniform" && scene.left != End::velocity &&
         scene.right != End::velocity && options.real("init_noise") == 0;
}

// Counts the processor time of a scope, the largest over the ranks.
class Clock {
 public:
  explicit Clock(double& sum) : sum_(sum), begin_(largest_processor_seconds()) {}
  ~Clock() {
    try {
      sum_ += largest_processor_seconds() - begin_;
    } catch (...) {  // NOLINT: a clock that fails must not hide why the scope ends
    }
  }
  Clock(const Clock&) = delete;
  Clock& operator=(const Clock&) = delete;

 private:
  double& sum_;
  double begin_;
};

}  // namespace

double expected_order(double earlier, double last, int p) {
  last = std::clamp(last, 0.5, double(p));
  if (last > 0.8 * p) return (last + p) / 2;
  const double rise = std::isnan(earlier) ? 0 : last - std::max(earlier, 0.);
  return rise > 0.3 ? last + std::min({(p - last) / 2, 0.8 * last, 1.5 * rise}) : last;
}

AccuracyPlan::AccuracyPlan(const Options& options, double wanted)
    : asked_(options), chosen_(options), wanted_(wanted), aim_(wanted), scene_(Scene::from(options, false)),
      probes_(options.reals("out_probes")) {
  read_what_is_set();
  // Finds what cannot be had before any work, and the start, as every run does.
  check_settings(asked_, {setting_});
  pilot_ = std::make_unique<Pilot>(asked_, scene_);
  {
    const Clock clock(seconds_);
    choose();
  }
  finish();
}
AccuracyPlan::~AccuracyPlan() = default;

void AccuracyPlan::read_what_is_set() {
  const auto is_set = [&](const std::string& name) { return asked_.is_set(name); };
  const bool sticks = Stick::applies_to(scene_);
  if (sticks && scene_.form != Form::chain)
    throw UsageError("accuracy " + asked_.text("accuracy") + " with friction_stick exact in the continuum: eta does "
                     "not converge at the ends of what sticks; set grid and tolerances, or friction_stick regularised");
  has_space_ = has_grid_limit(asked_, scene_) && !is_uniform(asked_, scene_);
  grid_open_ = has_space_ && !is_set("grid_n");
  order_open_ = has_space_ && !is_set("grid_order");
  method_open_ = !is_set("ts_type");
  tolerance_open_ = !is_set("ts_rtol") && !is_set("ts_atol");
  for (const Method& m : methods())
    if (const std::string name = subtype_option(m.type); method_open_ && !name.empty() && is_set(name))
      throw UsageError("-" + name + " " + asked_.text(name) + " with -accuracy: set ts_type as well");
  if (is_set("ts_adapt_type"))
    throw UsageError("-ts_adapt_type " + asked_.text("ts_adapt_type") + ": with -accuracy steps follow the error "
                     "estimate of the method; leave it out");
  if (method_open_) {
    setting_.method = MethodChoice::parse("accuracy", "rk:7vr");
  } else {
    const std::string type = asked_.text("ts_type"), sub = subtype_option(type);
    const std::string text = type + (!sub.empty() && is_set(sub) ? ":" + asked_.text(sub) : "");
    setting_.method = MethodChoice::parse("ts_type", text);
    if (!setting_.method.has_estimate())
      throw UsageError("-ts_type " + text +
                       ": it has no error estimate, which -accuracy needs; use rk, arkimex or rosw");
    if (is_set("imex_implicit")) setting_.method.implicit = asked_.text("imex_implicit");
  }
  if (!tolerance_open_)
    setting_.tolerance =
        std::min(is_set("ts_rtol") ? asked_.real("ts_rtol") : 1., is_set("ts_atol") ? asked_.real("ts_atol") : 1.);
  setting_.order = order_open_ ? possible_orders(scene_).back() : scene_.order;
  setting_.n = grid_open_ ? nodes(64) : scene_.n;
}

void AccuracyPlan::choose() {
  if (method_open_ && !Stick::applies_to(scene_)) {
    const Rates rates = pilot_->rates(setting_.order, setting_.n);
    const double own = std::max(std::sqrt(scene_.A() * scene_.K0()), 1e-3);  // frequency of a free block
    const bool faster = rates.friction > 10 * std::max(rates.wave, 40 * own);
    friction_sets_steps_ = rates.friction > 3 * rates.wave;
    if (rates.stiff_friction || rates.stiff_wave || (faster && wanted_ > 3e-4)) {
      setting_.method = MethodChoice::parse("accuracy", "rosw:ra34pw2");
      why_ = "explicit steps would be bound by stability";
    }
  }
  has_space_ ? climb() : descend();
}

// Whether an explicit run on n nodes takes less than `implicit_seconds`. Its steps are bound by stability: about six
// over the fastest frequency long (the friction's is seldom met, but at a threshold always), of ten stages of 1.2 ns a
// node (a smoothed threshold: 7), and 1 us each.
bool AccuracyPlan::prefers_explicit(double implicit_seconds, PetscInt n) const {
  if (!method_open_ || setting_.method.is_explicit()) return false;
  const Rates rates = pilot_->rates(setting_.order, n);
  const bool threshold = has_threshold(scene_.friction.law);
  const double steps = (threshold ? 0.22 : 0.16) * pilot_->t_end() * std::max(rates.wave, rates.friction);
  return steps * (1e-6 + (threshold ? 7e-8 : 1.2e-8) * double(n)) < implicit_seconds;
}

AccuracyPlan::Rung AccuracyPlan::rung(PetscInt n, double tolerance, std::string& failed) {
  const Setting s{setting_.method, tolerance, 0, setting_.order, n};
  ++trials_;
  Trial trial = Pilot::suits(scene_, s.method) ? pilot_->run(s, most_seconds) : run_trial(asked_, s, "", most_seconds);
  double most[2] = {trial.seconds, trial.failed.empty() ? 0. : 1.};  // a rank may find that it takes too long
  SS_TRY(MPI_Allreduce(MPI_IN_PLACE, most, 2, MPI_DOUBLE, MPI_MAX, PETSC_COMM_WORLD));
  if (most[1] > 0 && trial.failed.empty()) trial.failed = "it took too long";
  failed = trial.failed;
  Scene scene = scene_;
  scene.n = n;
  scene.order = setting_.order;
  return {scene, tolerance, std::move(trial.end), trial.steps, most[0]};
}

AccuracyPlan::Rung AccuracyPlan::rung(PetscInt n, double tolerance) {
  std::string failed;
  Rung made = rung(n, tolerance, failed);
  if (!failed.empty())
    give_up(setting_.method.name() + (has_space_ ? " on " + std::to_string(n) + " nodes" : "") + " at tolerance " +
            rounded(tolerance) + ": " + failed);
  return made;
}

void AccuracyPlan::give_up(const std::string& why) const {
  throw Failure("accuracy " + rounded(wanted_) + " is out of reach: " + why);
}

double AccuracyPlan::difference(const Rung& a, const Rung& b) const {
  const bool a_coarser = a.scene.n <= b.scene.n;
  const Rung &coarse = a_coarser ? a : b, &fine = a_coarser ? b : a;
  const double d = std::max(distance(coarse.fields, brought_to(coarse.scene, fine.scene, fine.fields)),
                            distance_between_nodes(coarse.scene, coarse.fields, fine.scene, fine.fields));
  if (probes_.empty()) return d;
  return std::max(
      d, distance(at_points(coarse.fields, coarse.scene, probes_), at_points(fine.fields, fine.scene, probes_)));
}

// ---- a ladder of grids ----

double AccuracyPlan::cells(const Scene& scene) { return double(scene.ring() ? scene.n : scene.n - 1); }

// So many cells or a few more: on a ring of equal parts the same in each.
PetscInt AccuracyPlan::nodes(double wanted_cells) const {
  Scene whole = scene_;
  whole.n = 720720;  // divided by every number to 16
  const bool reduces = asked_.text("scene_reduce") != "off";
  const PetscInt parts = reduces ? std::max<PetscInt>(1, promised_cells(whole, asked_)) : 1;
  const PetscInt least = setting_.order + (scene_.ring() ? 2 : 1);
  PetscInt count = std::max(least, PetscInt(std::ceil(wanted_cells - 1e-9)));
  if (parts < 100) count = (count + parts - 1) / parts * parts;
  return count + (scene_.ring() ? 0 : 1);
}

// Few enough that hardly a request is met by them: they cost next to nothing.
PetscInt AccuracyPlan::first_cells() const {
  const std::string type = asked_.text("init_type");
  double count = 12;
  if (type == "sine") count = 12 * std::max(1., asked_.real("init_mode"));
  if (type == "pulses" || type == "wave") count = 24 * asked_.real("init_pulses");
  if (type == "layer") count = 3 * scene_.length / asked_.real("init_width");
  // where friction sets the steps, a step on few nodes costs as much as one on some fifty
  if (friction_sets_steps_ && setting_.method.is_explicit()) count = std::max(count, 48.);
  if (scene_.spread > 0) count = std::max(count, 0.8 * scene_.length / scene_.spread_length);
  return PetscInt(std::min(count, 1e5));
}

// No finite differences of higher order converge faster than a medium whose third derivative jumps lets them.
int AccuracyPlan::order_at_best() const { return scene_.spread > 0 ? std::min(4, setting_.order) : setting_.order; }

double AccuracyPlan::rate(std::size_t k) const {
  return std::log(distances_[k - 1] / distances_[k]) /
         std::log(cells(rungs_[k].scene) / cells(rungs_[k - 1].scene));
}

double AccuracyPlan::order_beyond() const {
  const std::size_t known = distances_.size();
  if (known < 2) return scene_.spread > 0 ? 0.75 * order_at_best() : order_at_best() / 2.;
  return expected_order(known > 2 ? rate(known - 2) : NAN, rate(known - 1), order_at_best());
}

// And beyond that.
double AccuracyPlan::next_order() const {
  if (distances_.size() < 2) return order_beyond();
  return expected_order(rate(distances_.size() - 1), order_beyond(), order_at_best());
}

double AccuracyPlan::error_foreseen(double at) const {
  const double before = cells(rungs_[rungs_.size() - 2].scene), last = cells(rungs_.back().scene);
  const double near = std::min(at, last), far = std::max(at, last);
  return distances_.back() * std::pow(before / near, order_beyond()) * std::pow(last / far, next_order());
}

// Of a rung on a grid of so many cells. A strict one costs little: it is chosen for the least error in space that the
// rung may have.
double AccuracyPlan::tolerance_of_rung(double at) const {
  if (!tolerance_open_) return setting_.tolerance;
  const std::size_t count = rungs_.size();
  double in_space = 1;
  if (count >= 2) in_space = distances_.back() * std::pow(cells(rungs_[count - 2].scene) / at, order_at_best());
  else if (per_tolerance_cells_ > 0 || (count == 1 && friction_sets_steps_)) in_space = 0;
  const double grown = per_tolerance_cells_ > 0 ? std::max(1., at / per_tolerance_cells_) : 1;
  return std::clamp(share_of_rung * std::max(in_space, share_of_space * aim_) / (per_tolerance_ * grown),
                    least_tolerance, 1e-4);
}

void AccuracyPlan::add(Rung made) {
  if (!rungs_.empty()) distances_.push_back(std::max(difference(rungs_.back(), made), 1e-300));
  rungs_.push_back(std::move(made));
}

void AccuracyPlan::begin_anew() {
  rungs_.clear();
  distances_.clear();
}

void AccuracyPlan::take_explicit() {
  setting_.method = MethodChoice::parse("accuracy", "rk:7vr");
  why_.clear();
  begin_anew();
}

AccuracyPlan::Outlook AccuracyPlan::outlook() const {
  const double p = order_at_best(), last = cells(rungs_.back().scene), beyond = next_order();
  // where friction sets the steps, a finer grid costs little, and another run much
  const double share = friction_sets_steps_ && setting_.method.is_explicit() ? 0.12 : share_of_space;
  Outlook ahead;
  ahead.error = error_foreseen(last);
  ahead.order = order_beyond();
  ahead.factor = std::pow(ahead.error / (share * aim_), 1 / beyond);
  ahead.sure = ahead.order > 0.8 * p;
  // an order that has hardly begun to rise foresees nothing
  ahead.resolved = distances_.back() < (distances_.size() < 2 ? 20 : 3) * share_of_space * aim_ ||
                   (distances_.size() > 1 && rate(distances_.size() - 1) > 0.25 * p);
  ahead.within_reach =
      ahead.resolved && ahead.factor < std::clamp(std::pow(telling, 1 / beyond), 1.3, ahead.sure ? 8. : 2.2);
  return ahead;
}

// Grid and tolerance of the run, as the last rung foresees them.
void AccuracyPlan::place_run(const Outlook& ahead) {
  const double last = cells(rungs_.back().scene);
  // Near the last rung the distance from it would tell nothing.
  const double least = std::max(std::pow(0.4, -1 / next_order()), least_stretch_);
  if (grid_open_) setting_.n = nodes(last * (ahead.factor > 0.93 ? std::max(ahead.factor, least) : ahead.factor));
  Scene run = scene_;
  run.n = setting_.n;
  in_space_ = error_foreseen(cells(run));
  choose_tolerance_on(cells(run), in_space_);
}

// Whether it is the steps in time whose errors do not fall from grid to grid: then it is begun anew with stricter ones.
bool AccuracyPlan::time_is_to_blame() {
  if (!tolerance_open_ || restarts_ == 4 || rungs_.back().tolerance <= 2 * least_tolerance) return false;
  ++restarts_;
  const Rung& seen = rungs_[rungs_.size() - 2];
  const Rung loose = rung(seen.scene.n, loosened * seen.tolerance);
  const double d = difference(seen, loose);
  if (d <= 0.3 * loosened * distances_.back()) return false;
  per_tolerance_ = 3 * d / loose.tolerance;
  per_tolerance_cells_ = cells(seen.scene);
  begin_anew();
  return true;
}

void AccuracyPlan::give_up_on(const Outlook& ahead) const {
  const double last = distances_.size() > 1 ? rate(distances_.size() - 1) : NAN, p = order_at_best();
  give_up("on " + std::to_string(rungs_.back().scene.n) + " nodes the error is about " + rounded(ahead.error) +
          (last < 0.3 ? " and does not fall from grid to grid" : " and falls like h^" + rounded(last)) +
          ", as it does at " +
          (last < 0.3 * p ? "jumps, corners and fronts thinner than that grid" : "fronts that are not resolved") +
          "; best reached " + rounded(ahead.error));
}

void AccuracyPlan::climb() {
  const double set_cells = cells(scene_);
  const auto first = [&] {
    if (grid_open_) return double(first_cells());
    return set_cells / 2.25 < setting_.order + 2 ? 1.5 * set_cells : set_cells / 2.25;
  };
  const auto second = [&](const Rung& before) {
    const bool cheap = double(before.steps) * double(before.scene.n) < 5000 || friction_sets_steps_;
    const double ratio = grid_open_ ? (cheap ? 2 : 1.5) : before.scene.n > scene_.n ? 1 / 1.5 : 1.5;
    return ratio * cells(before.scene);
  };
  double next = first();
  for (int failures = 0;;) {
    if (rungs_.size() == 1) next = second(rungs_[0]);
    if (rungs_.size() >= 2) {
      const Outlook ahead = outlook();
      const Rung& last = rungs_.back();
      const PetscInt n = last.scene.n;
      const bool place = !grid_open_ || ahead.within_reach;
      double seconds = last.seconds * ahead.factor;  // of the run, if it is implicit
      if (place) {
        place_run(ahead);
        seconds = last.seconds * double(setting_.n) / double(n) *
                  std::pow(last.tolerance / setting_.tolerance, 1. / 3);
      }
      if (prefers_explicit(seconds, place ? setting_.n : n)) {
        take_explicit();
        next = first();
      } else if (place) {
        return;
      } else {
        const bool hopeless = n > 2000 && (cells(last.scene) * ahead.factor > double(most_nodes) ||
                                           last.seconds * ahead.factor * ahead.factor > most_seconds);
        next = cells(last.scene) * (ahead.resolved ? std::clamp(ahead.factor / 1.45, 1.3, ahead.sure ? 4. : 2.) : 2);
        const double coarser = cells(rungs_[rungs_.size() > 2 ? rungs_.size() - 3 : 0].scene);
        if (hopeless && time_is_to_blame()) next = coarser;
        else if (hopeless || 2 * n > most_nodes) give_up_on(ahead);
      }
    }
    std::string failed;
    Rung made = rung(nodes(next), tolerance_of_rung(next), failed);
    // what the run would cost on some 2/accuracy^(1/p) times as many nodes at a hundredth of the accuracy
    const double grown = 2 * std::pow(std::min(aim_, 1.), -1. / setting_.order);
    const double seconds = made.seconds * grown * std::pow(made.tolerance / (0.01 * aim_), 1. / 3);
    const bool slow = rungs_.empty() && prefers_explicit(seconds, nodes(next * grown));
    if (failed.empty() && !slow) {
      add(std::move(made));
    } else if (method_open_ && !setting_.method.is_explicit()) {
      take_explicit();
      next = first();
    } else if (grid_open_ && ++failures < 6) {
      next *= 2;
    } else {
      give_up(setting_.method.name() + " on " + std::to_string(nodes(next)) + " nodes: " + failed);
    }
  }
}

// What a tolerance costs, seen on the grid before the last, and with it that of the run.
void AccuracyPlan::choose_tolerance_on(double run_cells, double in_space) {
  const Rung& seen = rungs_[rungs_.size() - 2];
  double most = std::min(loosened * seen.tolerance, setting_.method.is_explicit() ? 3e-4 : 1e-2);
  // steps that hardly depend on grid and tolerance: a strict tolerance costs nothing, and nothing need be known of it
  const bool bound = double(rungs_.back().steps) < 1.1 * double(seen.steps) &&
                     rungs_.back().tolerance < 0.1 * seen.tolerance;
  if (bound) {
    most = rungs_.back().tolerance;
    per_tolerance_cells_ = cells(seen.scene);
  }
  if (!bound && (per_tolerance_cells_ == 0 || per_tolerance_cells_ < 0.6 * cells(seen.scene))) {
    const bool loosen = tolerance_open_ && seen.tolerance * loosened < 0.1;
    Rung other = rung(seen.scene.n, loosen ? loosened * seen.tolerance : std::max(seen.tolerance / loosened, 1e-14));
    if (loosen && double(other.steps) > 0.9 * double(seen.steps)) most = seen.tolerance;  // nothing to be saved
    // the same steps, which only grew: the difference tells nothing
    if (loosen && other.steps == seen.steps) other = rung(seen.scene.n, std::max(seen.tolerance / 100, 1e-14));
    per_tolerance_ = std::max(difference(seen, other) / std::max(seen.tolerance, other.tolerance), 0.1);
    per_tolerance_cells_ = cells(seen.scene);
  }
  const double grown = per_tolerance_ * std::max(1., run_cells / per_tolerance_cells_);
  if (tolerance_open_) {
    const double in_time =
        std::clamp(share_in_all * aim_ - in_space, share_of_time * aim_, (share_in_all - 0.05) * aim_);
    setting_.tolerance = std::clamp(in_time / (1.5 * grown), least_tolerance, most);
  }
  in_time_ = grown * setting_.tolerance;
  if (in_time_ > wanted_)
    give_up("at tolerance " + rounded(setting_.tolerance) + " the error in time is still about " + rounded(in_time_) +
            (tolerance_open_ ? " (the motion amplifies what is lost)" : " (ts_rtol, ts_atol as set)"));
}

// ---- a ladder of tolerances ----

double AccuracyPlan::slope() const {
  const double usual = setting_.method.is_explicit() ? 1 : 0.75, most = setting_.method.is_explicit() ? 1.25 : 0.75;
  const std::size_t known = distances_.size();
  if (known < 2) return usual;
  return std::clamp(std::log(distances_[known - 2] / distances_[known - 1]) /
                        std::log(rungs_[known - 2].tolerance / rungs_[known - 1].tolerance), 0.5, most);
}

double AccuracyPlan::time_foreseen(double tolerance) const {
  return distances_.back() * std::pow(tolerance / rungs_[rungs_.size() - 2].tolerance, slope());
}

void AccuracyPlan::descend() {
  const auto most = [&] { return setting_.method.is_explicit() ? 1e-2 : 1e-4; };
  const auto first = [&] { return std::clamp(10 * aim_, 1e-12, most()); };
  double next = tolerance_open_ ? first() : setting_.tolerance / loosened;
  for (;;) {
    std::string failed;
    Rung made = rung(scene_.n, next, failed);
    if (!failed.empty()) {
      if (!method_open_ || setting_.method.is_explicit())
        give_up(setting_.method.name() + " at tolerance " + rounded(next) + ": " + failed);
      take_explicit();
      next = first();
      continue;
    }
    if (!tolerance_open_) {
      rungs_ = {std::move(made)};
      in_time_ = NAN;
      return;
    }
    if (!rungs_.empty() && made.steps == rungs_.back().steps) {  // they only grew: the difference tells nothing
      if (next <= 2 * least_tolerance) {
        rungs_.push_back(made);
        distances_.push_back(1e-15);
        setting_.tolerance = next;
        in_time_ = 1e-15;
        return;
      }
      next = std::max(next / 100, least_tolerance);
      continue;
    }
    if (!rungs_.empty()) distances_.push_back(std::max(difference(rungs_.back(), made), 1e-300));
    rungs_.push_back(std::move(made));
    const Rung& last = rungs_.back();
    if (rungs_.size() == 1) {
      next = std::max(last.tolerance / loosened, least_tolerance);
      continue;
    }
    const double before = rungs_[rungs_.size() - 2].tolerance, d = distances_.back();
    const double wish = before * std::pow(share_in_all * aim_ / d, 1 / slope());
    if (last.tolerance <= 2 * least_tolerance && d > aim_)
      give_up("at tolerance " + rounded(last.tolerance) + " the error in time is still about " + rounded(d) +
              " (the motion amplifies what is lost)");
    const bool early = setting_.method.is_explicit() && d > 1e-3;  // before errors fall as they will
    const bool within_reach = wish >= last.tolerance / (early ? 100 : loosened) ||
                              last.tolerance <= 2 * least_tolerance;
    if (prefers_explicit(last.seconds * std::pow(last.tolerance / wish, 1. / 3), scene_.n)) {
      take_explicit();
      next = first();
      continue;
    }
    if (within_reach) {
      // close to the last rung the distance from it would tell nothing
      const double off = setting_.method.is_explicit() ? 3 : 2;
      const bool near = wish > last.tolerance / off && wish < last.tolerance * off;
      const double told = !near                                                   ? wish
                          : !setting_.method.is_explicit() && time_foreseen(last.tolerance * off) < 0.85 * wanted_
                              ? last.tolerance * off
                              : last.tolerance / off;
      setting_.tolerance = std::clamp(told, least_tolerance, 3 * most());
      in_time_ = time_foreseen(setting_.tolerance);
      return;
    }
    next = std::max({10 * wish, last.tolerance / 1000, least_tolerance});
    if (next > last.tolerance / 3) next = last.tolerance / loosened;
  }
}

// ---- the run ----

double AccuracyPlan::estimate_in_space(const Rung& now, double d) const {
  const double p = order_at_best(), x = cells(now.scene) / cells(rungs_.back().scene);
  double r = next_order();
  // while orders are still far from p, more goes otherwise than foreseen
  const auto careful = [&](double error) { return (1.3 + 1.5 * (1 - r / p)) * error; };
  const std::size_t known = distances_.size();
  if (x < 0.97) {
    const double slow = known > 1 ? std::clamp(rate(known - 1), 0.5, p) : r;
    return careful(std::max(d + error_foreseen(cells(rungs_.back().scene)), d / (1 - std::pow(x, slow)) / 1.3));
  }
  if (x < 1.03) return careful(error_foreseen(cells(now.scene)));
  double error = d;
  for (int round = 0; round < 3; ++round) {
    // two grids that are close may err alike
    const double of_last =
        std::max(d / (1 - std::pow(x, -r)), x < 1.5 ? 0.6 * error_foreseen(cells(rungs_.back().scene)) : 0.);
    const double seen = std::log(distances_.back() / of_last) /
                        std::log(cells(rungs_.back().scene) / cells(rungs_[rungs_.size() - 2].scene));
    r = expected_order(known > 1 ? rate(known - 1) : NAN, seen, order_at_best());
    error = of_last * std::pow(x, -r);
  }
  return careful(error);
}

double AccuracyPlan::estimate_in_time(const Rung& now, double d) const {
  if (!tolerance_open_) return 1.2 * d;
  const Rung& last = rungs_.back();
  const double x = last.tolerance / now.tolerance;
  if (x < 0.7) return d / (1 - std::pow(x, slope()));
  if (x < 1) return std::max(d, time_foreseen(now.tolerance));
  const double usual = slope();
  if (d < 0.01 * time_foreseen(now.tolerance)) return time_foreseen(last.tolerance);  // the rung's own steps
  if (x < 3) return std::max(time_foreseen(now.tolerance), x > 1.5 ? d / (std::pow(x, usual) - 1) : 0);
  const double of_last = d / (1 - std::pow(x, -usual));
  const double seen = std::clamp(std::log(distances_.back() / of_last) /
                                     std::log(rungs_[rungs_.size() - 2].tolerance / last.tolerance), 0.5, 1.);
  return of_last * std::pow(x, -std::min(seen, std::max(usual, 0.75)));
}

double AccuracyPlan::estimate(const Fields& end) {
  const Clock clock(seconds_);
  Scene scene = scene_;
  scene.n = setting_.n;
  scene.order = setting_.order;
  last_run_ = {scene, setting_.tolerance, end, 0, 0};
  const double d = std::max(difference(rungs_.back(), last_run_), 1e-300);
  last_estimate_ = has_space_ ? estimate_in_space(last_run_, d) + 1.5 * in_time_
                              : (last_run_.tolerance > rungs_.back().tolerance ? 1.1 : 1.4) *
                                    estimate_in_time(last_run_, d);
  return last_estimate_;
}

void AccuracyPlan::refine() {
  const bool space = has_space_ && last_estimate_ - 1.5 * in_time_ > 0.5 * wanted_;
  if (space && !grid_open_)
    give_up("on grid_n " + std::to_string(setting_.n) + " as set the error is about " + rounded(last_estimate_));
  if (!tolerance_open_ && !space)
    give_up("at the tolerance " + rounded(setting_.tolerance) + " as set the error is about " +
            rounded(last_estimate_));
  {
    const Clock clock(seconds_);
    aim_ *= 0.7;
    const double before = setting_.tolerance;
    if (has_space_) {
      if (grid_open_ && cells(last_run_.scene) > 1.03 * cells(rungs_.back().scene)) {
        if (rungs_.size() > 2 && cells(last_run_.scene) < 1.3 * cells(rungs_.back().scene)) {  // too close to tell
          rungs_.pop_back();
          distances_.pop_back();
        }
        distances_.push_back(std::max(difference(rungs_.back(), last_run_), 1e-300));
        rungs_.push_back(last_run_);
      } else {
        aim_ *= 0.5;
      }
      if (grid_open_ && setting_.n > 5000 && next_order() < 0.3 * order_at_best()) {
        Outlook seen = outlook();
        seen.error = last_estimate_;
        give_up_on(seen);
      }
      least_stretch_ = std::min(std::pow(last_estimate_ / (share_in_all * wanted_), 1 / next_order()), 2.);
      climb();
    } else {
      const Rung& last = rungs_.back();
      if (before < last.tolerance / 2) {
        distances_.push_back(std::max(difference(last, last_run_), 1e-300));
        rungs_.push_back(last_run_);
      } else if (before > 1.5 * last.tolerance && before < rungs_[rungs_.size() - 2].tolerance) {
        distances_.back() = std::max(difference(last, last_run_), 1e-300);
        rungs_[rungs_.size() - 2] = last_run_;
        if (distances_.size() > 1)
          distances_[distances_.size() - 2] = difference(rungs_[rungs_.size() - 3], last_run_);
      }
      const double wish = rungs_[rungs_.size() - 2].tolerance *
                          std::pow(share_in_all * aim_ / distances_.back(), 1 / slope());
      if (before <= 2 * least_tolerance)
        give_up("at tolerance " + rounded(before) + " the error in time is still about " + rounded(last_estimate_) +
                " (the motion amplifies what is lost)");
      setting_.tolerance =
          std::clamp(std::min({wish, before / 3, rungs_.back().tolerance / 3}), least_tolerance, before);
      in_time_ = time_foreseen(setting_.tolerance);
    }
  }
  finish();
}

void AccuracyPlan::finish() {
  chosen_ = options_for(asked_, setting_);
  if (!has_space_) chosen_ = asked_.with("imex_implicit", chosen_.text("imex_implicit"));
  const auto set = [&](const std::string& name, const std::string& value) {
    if (!asked_.is_set(name)) chosen_ = chosen_.with(name, value);
  };
  set("ts_type", setting_.method.type);
  if (const std::string sub = subtype_option(setting_.method.type); !sub.empty()) set(sub, setting_.method.subtype);
  if (const double step = pilot_->longest_step(setting_); step > 0) set("ts_adapt_dt_max", number_text(step));
  set("ts_rtol", number_text(setting_.tolerance));
  set("ts_atol", number_text(setting_.tolerance));
  what_ = setting_.method.name() + (setting_.method.splits() ? " (implicit: " + setting_.method.implicit + ")" : "") +
          ", tolerance " + rounded(setting_.tolerance);
  if (has_space_) what_ += ", order " + std::to_string(setting_.order) + ", n = " + std::to_string(setting_.n);
  if (!std::isnan(in_time_)) what_ += "; error foreseen in time " + rounded(in_time_);
  if (has_space_)
    what_ += ", in space " + rounded(in_space_) + " (falling like h^" + rounded(order_beyond()) + ")";
  what_ += ", after " + std::to_string(trials_) + " short runs";
  if (!why_.empty()) what_ += "; " + why_;
}

}  // namespace stickslip
