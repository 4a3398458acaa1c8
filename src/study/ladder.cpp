#include "study/ladder.hpp"

#include <fmt/format.h>
#include <algorithm>
#include <cmath>
#include <limits>

#include "options/values.hpp"
#include "output/catalogue.hpp"
#include "output/measures.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/base/root.hpp"
#include "stickslip/base/text.hpp"
#include "stickslip/model/scene.hpp"
#include "stickslip/numerics/collocation.hpp"
#include "stickslip/options/library_options.hpp"
#include "stickslip/study/reduce.hpp"
#include "stickslip/time/methods.hpp"
#include "stickslip/time/stick.hpp"
#include "study/simulate.hpp"
#include "time/methods.hpp"

namespace stickslip {

namespace {

// Largest |difference| at the nodes of the finer grid: what the nodes of the coarser one miss of a front. By
// the polynomial through up to 12 nodes of the coarse grid, with mirror images at free ends; not near held
// ones.
double distance_between_nodes(const Scene& coarse, const Fields& of_coarse, const Scene& fine,
                              const Fields& of_fine) {
  const int half = int(std::min<PetscInt>(6, coarse.n / 2)), count = 2 * half;
  const GridEnd end = coarse.ring() ? GridEnd::periodic : GridEnd::mirrored;
  double largest = 0;
  for (PetscInt i = 0; i < fine.n; ++i) {
    const double at = std::min(fine.x(i) / coarse.h(), cells_of(coarse));
    const bool from_left = coarse.left == End::velocity && at < half - 1;
    if (from_left || (coarse.right == End::velocity && at >= double(coarse.n - half))) continue;
    const Combination row = grid_interpolation(coarse.n, end, end, count, at);
    if (row.size() == 1) continue;  // a node of both
    const Point point = combined(of_coarse, row, FrictionAt(), 0);
    largest = std::max({largest, std::abs(point.psi - of_fine.psi[i]), std::abs(point.eta - of_fine.eta[i])});
  }
  return largest;
}

bool is_uniform(const Options& options, const Scene& scene) {
  return scene.nodes_alike() && options.text("init_type") == "uniform" && scene.left != End::velocity &&
         scene.right != End::velocity && options.real("init_noise") == 0;
}

double corner_distance_of(const Options& options, const Scene& scene) {
  double distance = scene.nodes_alike() ? 0 : scene.friction_length();
  if (options.real("init_noise") != 0)
    distance = std::min(distance > 0 ? distance : HUGE_VAL, options.real("init_noise_length"));
  return distance;
}

int corner_order_of(const Options& options, const Scene& scene, const std::vector<Corner>& corners) {
  int order = scene.spread != 0 || options.real("init_noise") != 0 ? 4 : 8;
  for (const Corner& corner : corners) order = std::min(order, corner.order);
  return order;
}

// Where a jump lies between two nodes the grid moves it to between its cells: errors do not fall steadily
// from grid to grid.
PetscInt mesh_divisor_of(const Options& options, const Scene& scene, const std::vector<Corner>& corners) {
  constexpr PetscInt most = 1000;
  const PetscInt jumps = cells_between_corners(corners, scene, 1, most);
  const auto refuse = [&](const std::string& what) {
    throw UsageError("accuracy " + options.text("accuracy") +
                     ": a profile jumps, which a grid has to have at nodes: " + what +
                     ", or profile_kind smooth");
  };
  if (jumps == 0) refuse(fmt::format("no grid of up to {} cells has; move the jumps", most));
  if (options.is_set("grid_n") && PetscInt(cells_of(scene)) % jumps != 0)
    refuse(fmt::format("take a multiple of {} cells, not grid_n {}", jumps, options.text("grid_n")));
  if (options.is_set("grid_n")) return jumps;
  return std::max(jumps, cells_between_corners(corners, scene, 2, most));
}

// ts_atol of psi, in parts of its scale.
double parts_of_psi(const Options& options, const Scene& scene) {
  const std::string text = options.text("ts_atol");
  return text.rfind("auto", 0) == 0 ? MethodSpec::from(options).parts
                                    : options.real("ts_atol") / scales_of(scene).least.psi;
}

MethodSpec explicit_method() { return MethodSpec::parse("accuracy", "rk:7vr"); }

// The method that the user set. Throws UsageError where it gives no error estimate.
MethodSpec method_set(const Options& options) {
  const std::string type = options.text("ts_type"), sub = capabilities(offered_type(type)).subtype_option;
  const std::string text = type + (!sub.empty() && options.is_set(sub) ? ":" + options.text(sub) : "");
  MethodSpec method = MethodSpec::parse("ts_type", text);
  if (!method.can().has_estimate)
    throw UsageError("-ts_type " + text +
                     ": it has no error estimate, which -accuracy needs; use rk, arkimex or rosw");
  if (options.is_set("imex_implicit")) method.implicit = options.text("imex_implicit");
  return method;
}

}  // namespace

double cells_of(const Scene& scene) { return double(scene.ring() ? scene.n : scene.n - 1); }

double expected_order(double earlier, double last, double p) {
  last = std::clamp(last, 0.5, p);
  if (last > 0.8 * p) return (last + p) / 2;
  const double rise = std::isnan(earlier) ? 0 : last - std::max(earlier, 0.);
  return rise > 0.3 ? last + std::min({(p - last) / 2, 0.8 * last, 1.5 * rise}) : last;
}

// At a low order the finer of two errs by much of what the coarser does.
double FallingErrors::error(std::size_t k) const {
  return distances[k] / (1 - std::pow(fineness[k] / fineness[k + 1], best));
}

double FallingErrors::rate(std::size_t k) const {
  return std::log(error(k - 1) / error(k)) / std::log(fineness[k] / fineness[k - 1]);
}

double FallingErrors::order_between() const {
  const std::size_t known = distances.size();
  if (known < 2) return unseen;
  if (steady) return std::clamp(rate(known - 1), least, best);
  return expected_order(known > 2 ? rate(known - 2) : NAN, rate(known - 1), best);
}

double FallingErrors::order_beyond() const {
  if (steady || distances.size() < 2) return order_between();
  return expected_order(rate(distances.size() - 1), order_between(), best);
}

double FallingErrors::predicted(double at) const {
  const double last = fineness.back(), before = fineness[fineness.size() - 2], between = order_between();
  const double of_last = distances.back() / (std::pow(last / before, between) - 1);
  return of_last * std::pow(last / at, at > last ? order_beyond() : between);
}

// ---- what is asked ----

AccuracyRequest::AccuracyRequest(const Options& o, double accuracy)
    : options(o), scene(Scene::from(o, false)), wanted(accuracy),
      of(Quantity::from(o, "accuracy_of")), probes(of.places(o)),
      has_space(has_grid_limit(o, scene) && !is_uniform(o, scene)),
      grid_open(has_space && !o.is_set("grid_n")), order_open(has_space && !o.is_set("grid_order")),
      method_open(!o.is_set("ts_type")), tolerance_open(!o.is_set("ts_rtol") && !o.is_set("ts_atol")),
      corner_distance(corner_distance_of(o, scene)) {
  const std::vector<Corner> corners = has_space ? corners_of(scene) : std::vector<Corner>();
  corner_order = corner_order_of(o, scene, corners);
  mesh_divisor = has_space ? mesh_divisor_of(o, scene, corners) : 1;
  const std::string type = o.text("init_type");
  if (corner_order == 1 && (o.text("init_eta") != "steady" || type == "pulses" || type == "wave"))
    throw UsageError("accuracy " + o.text("accuracy") +
                     ": a profile jumps, and a start whose eta does not (init_eta " + o.text("init_eta") +
                     ") sends jumps along the characteristics, which no grid resolves: init_eta steady, or "
                     "profile_kind smooth");
  if (Stick::applies_to(scene) && scene.form != Form::chain) {
    if (!of.is_measured())
      throw UsageError("accuracy " + options.text("accuracy") +
                       " with friction_stick exact in the continuum: eta does not converge at the ends of "
                       "what sticks; accuracy_of period, amplitude, speed or events can be had, or set grid "
                       "and tolerances");
    corner_order = 1;  // what sticks ends between two nodes
  }
  for (const Method& m : methods())
    if (const std::string name = capabilities(m).subtype_option;
        method_open && !name.empty() && options.is_set(name))
      throw UsageError(fmt::format("-{} {} with -accuracy: set ts_type as well", name, options.text(name)));
  if (options.is_set("ts_adapt_type"))
    throw UsageError("-ts_adapt_type " + options.text("ts_adapt_type") +
                     ": with -accuracy steps follow the error estimate of the method; leave it out");
}

Setting AccuracyRequest::setting() const {
  Setting s;
  s.method = method_open ? explicit_method() : method_set(options);
  if (!tolerance_open)
    s.tolerance = std::min(options.is_set("ts_rtol") ? options.real("ts_rtol") : 1.,
                           options.is_set("ts_atol") ? parts_of_psi(options, scene) : 1.);
  s.order = order_open ? possible_orders(scene).back() : scene.order;
  s.n = grid_open ? nodes(64) : scene.n;
  return s;
}

PetscInt AccuracyRequest::nodes(double wanted_cells) const {
  Scene whole = scene;
  whole.n = 720720;  // divided by every number to 16
  const bool reduces = options.text("scene_reduce") != "off";
  const PetscInt parts = reduces ? std::max<PetscInt>(1, promised_cells(whole, options)) : 1;
  const int order = order_open ? possible_orders(scene).back() : scene.order;
  const PetscInt least = order + (scene.ring() ? 2 : 1);
  PetscInt count = std::max(least, PetscInt(std::ceil(wanted_cells - 1e-9)));
  if (parts < 100) count = (count + parts - 1) / parts * parts;
  count = (count + mesh_divisor - 1) / mesh_divisor * mesh_divisor;
  return count + (scene.ring() ? 0 : 1);
}

// ---- what the start tells ----

SceneAtStart::SceneAtStart(const Options& options, const Scene& scene)
    : options_(options), scene_(scene), start_(scene, options), t_end_(options.real("ts_max_time")),
      reduces_(options.text("scene_reduce") != "off") {}

Model SceneAtStart::model(int order, PetscInt n) const {
  const Scene scene = on_grid(scene_, n, order);
  const PetscInt cells = reduces_ ? promised_cells(scene, options_) : 1;
  return Model(PETSC_COMM_SELF, cells > 1 ? cell_of(scene, cells) : scene);
}

SceneAtStart::OnGrid SceneAtStart::on(int order, PetscInt n) const {
  std::vector<std::string> unheard;
  const WarningsKept kept(unheard);
  OnGrid start{model(order, n), {}};
  VecHandle u;
  SS_TRY(VecCreateSeq(PETSC_COMM_SELF, start.model.local() * start.model.dof(), u.out()));
  start_.fill(start.model, u);
  start.rates = rates_of(start.model, u);
  return start;
}

MethodSpec SceneAtStart::automatic(const OnGrid& start, double tolerance) const {
  std::vector<std::string> unheard;
  const WarningsKept kept(unheard);
  MethodSpec open = MethodSpec::from(options_);
  open.tolerance = tolerance;
  const Choice choice = choose_method(start.model, start.rates, open, "");
  if (choice.implicit == Implicit::none) return MethodSpec::parse("accuracy", "rk:7vr");
  return MethodSpec::parse("accuracy", choice.type + ":" + choice.subtype + ":" + to_string(choice.implicit));
}

double SceneAtStart::longest_step(const Setting& setting) const {
  if (options_.is_set("ts_adapt_dt_max")) return options_.real("ts_adapt_dt_max");
  if (setting.method.name() != "rk:7vr") return 0;
  const Scene scene = on_grid(scene_, setting.n, setting.order);
  const bool waves = !reduces_ || promised_cells(scene, options_) < scene.n;
  return waves ? 4.4 / stencil_rate(scene) : 0;
}

// ---- runs ----

LevelRuns::LevelRuns(const AccuracyRequest& request, Setting& setting)
    : request_(request), setting_(setting), at_start_(request.options, request.scene),
      jump_(request.has_space ? Jump::of(request.scene, at_start_.start()) : std::nullopt),
      automatic_(setting.method) {}

bool LevelRuns::affords(double seconds) const {
  return spent_ + seconds <= request_.options.real("accuracy_seconds");
}

Level LevelRuns::run(PetscInt n, double tolerance) {
  Setting s{setting_.method, tolerance, 0, setting_.order, n};
  // The start does not tell how fast friction acts later on.
  const bool may_stop =
      s.method.can().is_explicit && !automatic_.can().is_explicit && explicit_steps_seen_ == 0;
  if (may_stop) s.most_attempts = most_explicit_steps(n);
  ++count_;
  Trial made = trial(s, std::max(1., request_.options.real("accuracy_seconds") - spent_));
  const TimeReport& report = made.report;
  const std::int64_t attempts = report.steps + report.rejections;
  if (may_stop && made.fault == Fault::too_many_steps && report.t > 0)
    explicit_steps_seen_ = double(attempts) * at_start_.t_end() / report.t;
  double most[2] = {made.seconds, made.is_answer() ? 0. : 1.};  // a rank may find that it takes too long
  largest_over(PETSC_COMM_WORLD, most, 2);
  spent_ += most[0];
  if (most[1] > 0)
    throw OutOfReach{fmt::format("{}{} at tolerance {:.2g}: {}", setting_.method.name(),
                                 request_.has_space ? fmt::format(" on {} nodes", n) : "", tolerance,
                                 made.is_answer() ? "it took too long" : made.failed)};
  Answer answer{std::move(made.end), std::move(made.measured)};
  return {on_grid(request_.scene, n, s.order), tolerance, std::move(answer), report.steps, attempts, most[0]};
}

Trial LevelRuns::trial(const Setting& s, double limit) const {
  const MeasureMaker measure = request_.of.measure(request_.options);
  const double longest = at_start_.longest_step(s);  // as the run will have it
  const Options& asked = request_.options;
  const Options bounded = longest > 0 ? asked.with("ts_adapt_dt_max", number_text(longest)) : asked;
  const LibraryOptionsHeld held(asked, bounded);
  Trial made = run_trial(asked, s, "", limit, measure);
  if (measure && made.is_answer() && made.measured.empty())
    made.fail(Fault::failed, request_.of.missing());
  return made;
}

// Where a solution on this grid is compared: its nodes, unless a probe alone is wanted, and the probes; not
// about a jump.
std::vector<double> LevelRuns::places(const Scene& scene) const {
  std::vector<double> x;
  if (request_.of.kind != Quantity::Kind::probe) x = positions(scene, 0, scene.n);
  x.insert(x.end(), request_.probes.begin(), request_.probes.end());
  if (!jump_) return x;
  const Jump::Extent left_out = jump_->extent(scene, at_start_.t_end());
  x.erase(std::remove_if(x.begin(), x.end(), [&](double at) { return left_out.covers(at); }), x.end());
  return x;
}

double LevelRuns::difference(const Level& a, const Level& b, bool between) const {
  const bool a_coarser = a.scene.n <= b.scene.n;
  const Level &coarse = a_coarser ? a : b, &fine = a_coarser ? b : a;
  double d = std::numeric_limits<double>::min();
  if (request_.of.is_measured()) {
    const double apart = Quantity::difference(coarse.answer.measured, fine.answer.measured);
    return std::max(d, std::isfinite(apart) ? apart : at_start_.t_end());  // an event is missed
  }
  const std::vector<double> x = places(coarse.scene);
  Fields rough = at_points(coarse.answer.fields, coarse.scene, x),
         exact = at_points(fine.answer.fields, fine.scene, x);
  if (jump_) rough.eta = exact.eta;
  d = std::max(d, distance(rough, exact));
  const bool smooth = request_.corner_distance == 0 && !jump_ && request_.of.kind == Quantity::Kind::fields;
  if (!between || coarse.scene.n == fine.scene.n || !smooth) return d;
  return std::max(d,
                  distance_between_nodes(coarse.scene, coarse.answer.fields, fine.scene, fine.answer.fields));
}

void LevelRuns::choose_method(double tolerance) {
  if (!request_.method_open || Stick::applies_to(request_.scene)) return;
  const SceneAtStart::OnGrid start = at_start_.on(setting_.order, setting_.n);
  friction_sets_steps_ = start.rates.friction > 3 * start.rates.wave;
  automatic_ = at_start_.automatic(start, tolerance);
  // the first levels of an implicit method take longer than that
  constexpr double cheap = 2e-3;
  const bool is_cheap = explicit_seconds(start.rates, setting_.n) < cheap;
  const bool wanted = request_.options.is_set("imex_implicit");
  if (!automatic_.can().is_explicit && (wanted || !is_cheap)) take_implicit();
}

// About what a step by a method takes, the solving of its equations included. What decides between
// methods is such a count and no measured time, so that the same request gives the same run. Of rk:7vr ten
// stages of 1.2 ns a node (a smoothed threshold: 7).
double LevelRuns::step_seconds(const MethodSpec& method, PetscInt n) const {
  struct Price {
    double step, node;
  };
  const Price price = method.can().is_explicit
                          ? Price{1e-6, request_.scene.friction.jumps_at_rest() ? 7e-8 : 1.2e-8}
                      : method.implicit == "friction" ? Price{6e-6, 6e-8}
                                                      : Price{1.2e-5, 1.3e-7};
  return price.step + price.node * double(n);
}

// Steps of an explicit run are bound by stability: about six over the fastest frequency long (the friction's
// is seldom met, but at a threshold always).
double LevelRuns::explicit_steps(const Rates& rates) const {
  const bool threshold = request_.scene.friction.jumps_at_rest();
  const double steps = (threshold ? 0.22 : 0.16) * at_start_.t_end() * std::max(rates.wave, rates.friction);
  return std::max(steps, explicit_steps_seen_);
}

double LevelRuns::explicit_seconds(const Rates& rates, PetscInt n) const {
  return explicit_steps(rates) * step_seconds(explicit_method(), n);
}

// Many more than accuracy alone asks for.
std::int64_t LevelRuns::most_explicit_steps(PetscInt n) const {
  return std::int64_t(std::max(5000., 30 * explicit_steps(at_start_.on(setting_.order, n).rates)));
}

bool LevelRuns::prefers_explicit(const Level& seen, PetscInt n, double tolerance) const {
  if (!request_.method_open || setting_.method.can().is_explicit || request_.options.is_set("imex_implicit"))
    return false;
  // steps of an implicit run are bound by their error
  const double steps =
      double(seen.attempts) * std::pow(seen.tolerance / tolerance, 1. / setting_.method.order());
  return explicit_seconds(at_start_.on(setting_.order, n).rates, n) <
         steps * step_seconds(setting_.method, n);
}

void LevelRuns::take_explicit() {
  setting_.method = explicit_method();
  why_.clear();
}

void LevelRuns::take_implicit() {
  setting_.method = automatic_;
  why_ = "explicit steps would be bound by stability";
}

bool LevelRuns::take_other() {
  if (!request_.method_open) return false;
  const bool is_explicit = setting_.method.can().is_explicit;
  if (is_explicit && (explicit_steps_seen_ == 0 || gave_up_implicit_)) return false;
  gave_up_implicit_ = !is_explicit;
  is_explicit ? take_implicit() : take_explicit();
  return true;
}

Quantity Quantity::from(const Options& options, const std::string& option) {
  const std::string text = options.text(option);
  const UsageError wrong(
      option + " " + quoted(text) +
      ": it is fields, speed, period, amplitude, events, or probe:x with a place x of the scene");
  if (text.rfind("probe:", 0) == 0) {
    const auto x = parse_number(text.substr(6));
    const bool inside = x && *x >= 0 && *x <= Scene::from(options, false).length;
    if (!inside) throw UsageError(wrong);
    return {Kind::probe, *x};
  }
  if (text == "fields") return {};
  if (text == "speed") return {Kind::speed};
  if (text == "amplitude") return {Kind::amplitude};
  if (text == "events") {
    (void)event_velocity(options, Scene::from(options, false), option + " events");
    return {Kind::events};
  }
  if (text != "period") throw UsageError(wrong);
  return {Kind::period};
}

namespace {

// Of out_probes, if given; else the middle of the scene, in a chain the block there that is not held.
std::vector<double> places_of_period(const Options& options) {
  if (options.is_set("out_probes")) return options.reals("out_probes");
  const Scene scene = Scene::from(options, false);
  if (scene.form == Form::continuum) return {scene.length / 2};
  const PetscInt middle = scene.n / 2;
  return {scene.x(scene.held(middle) && middle > 0 ? middle - 1 : middle)};
}

}  // namespace

std::vector<double> Quantity::places(const Options& options) const {
  if (kind == Kind::probe) return {x};
  return kind == Kind::fields ? options.reals("out_probes") : std::vector<double>();
}

MeasureMaker Quantity::measure(const Options& options) const {
  const double t_end = options.real("ts_max_time");
  switch (kind) {
    case Kind::speed:
      return [t_end](const Model& model, const Scene&) { return std::make_unique<WaveSpeed>(model, t_end); };
    case Kind::amplitude:
      return [t_end](const Model& model, const Scene&) { return std::make_unique<Amplitude>(model, t_end); };
    case Kind::period:
      return [t_end, x = places_of_period(options)](const Model& model, const Scene& whole) {
        return std::make_unique<Period>(model, whole, x, t_end, true);
      };
    case Kind::events:
      return [options](const Model& model, const Scene& whole) {
        return std::make_unique<EventTimes>(model, event_velocity(options, whole, "events"));
      };
    case Kind::fields:
    case Kind::probe: break;
  }
  return nullptr;
}

double Quantity::difference(const std::vector<double>& one, const std::vector<double>& other) {
  if (one.size() != other.size()) return HUGE_VAL;
  double largest = 0;
  for (std::size_t i = 0; i < one.size(); ++i) largest = std::max(largest, std::abs(one[i] - other[i]));
  return largest;
}

std::string Quantity::name() const {
  switch (kind) {
    case Kind::speed: return "wave_speed";
    case Kind::amplitude: return "amplitude";
    case Kind::period: return "period";
    case Kind::probe: return "probe";
    case Kind::events: return "events";
    case Kind::fields: break;
  }
  return "fields";
}

}  // namespace stickslip
