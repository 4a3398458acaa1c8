#include "stickslip/study/accuracy.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "stickslip/base/error.hpp"
#include "stickslip/time/methods.hpp"
#include "study/ladder.hpp"

namespace stickslip {

namespace {

// Parts of the accuracy: the error predicted in space, beside a jump, and without a grid; that in time beside
// it.
constexpr double share_of_space = 0.35, share_beside_jump = 0.55, share_alone = 0.5;
constexpr double share_of_time = 0.1;
constexpr double loosened = 30;  // the tolerance that tells what a tolerance costs, over that of the levels
constexpr double least_tolerance = 1e-14;
constexpr double telling = 50;  // a level predicts errors down to this part of its own
constexpr PetscInt most_nodes = 1 << 20;

}  // namespace

// Levels are ever finer: by the cells of their grid, at one tolerance; without a grid by 1/tolerance. Their
// errors are a power of that, and so are the distances of neighbours. With a grid the run is finer than the
// last level, without one coarser.
struct AccuracyPlan::Impl {
  AccuracyRequest request;
  Setting setting;
  LevelRuns runs;
  Options chosen;
  std::string what, refusal;
  double seconds = 0;

  double aim;                        // below the request after a run that erred by more
  double tolerance = 0;              // of levels on grids
  double next = 0;                   // fineness of the next level; 0: of the first, to be found
  double least = 0;                  // fineness of the run, at least
  std::vector<Level> levels;         // coarse to fine
  std::vector<double> distances;     // of levels k and k + 1: the error of level k
  double in_space = 0, in_time = 0;  // predicted of the run
  struct {
    double tolerance = 0, cells = 0, error = 0;
  } seen_in_time;  // of the levels' steps
  int restarts = 0, failures = 0;
  Level last_run;
  double last_estimate = 0;

  Impl(const Options& options, double wanted)
      : request(options, wanted), setting(checked(request)), runs(request, setting), chosen(options),
        aim(wanted) {}

  // Finds what cannot be had before any work, and the start, as every run does.
  static Setting checked(const AccuracyRequest& request) {
    const Setting setting = request.setting();
    check_settings(request.options, {setting});
    return setting;
  }
  std::string out_of_reach(const OutOfReach& e) const {
    return fmt::format("accuracy {:.2g} is out of reach: {}", request.wanted, e.why);
  }
  // With the processor time that it takes counted.
  template <class Work>
  auto timed(const Work& work) {
    struct Clock {
      double &seconds, begin = largest_processor_seconds();
      ~Clock() { seconds += largest_processor_seconds() - begin; }
    } clock{seconds};
    return work();
  }

  // In units of the last level's fineness.
  struct Ahead {
    double run, next;  // where the run is to be, and the next level
    bool within;       // reach of the levels
  };

  bool has_space() const { return request.has_space; }
  double fineness(const Level& l) const { return has_space() ? cells_of(l.scene) : 1 / l.tolerance; }
  double last() const { return fineness(levels.back()); }
  // Errors fall with the tolerance as they do where nothing is stiff and no threshold is crossed.
  bool smooth() const { return setting.method.can().is_explicit && request.scene.friction.smooth(); }
  bool scatters() const { return setting.method.can().is_explicit && !smooth(); }
  double slope_in_time() const { return smooth() ? 1 : 0.75; }
  // Whether rates are what they are from the beginning, and do not rise as fronts are resolved.
  bool steady() const { return !has_space() || runs.jump() || request.corner_order <= 2; }
  double loosest() const { return setting.method.can().is_explicit ? 1e-2 : 1e-4; }
  // of the last level, without a grid
  double lead() const { return setting.method.can().is_explicit ? 10 : 4; }

  // ---- how errors fall ----

  // No finite differences of higher order converge faster than a jump lets them, or a medium or a start whose
  // third derivative jumps.
  double best_order() const {
    if (!has_space()) return smooth() ? 1.25 : 0.75;
    const double order = runs.jump() ? setting.order / (setting.order + 1.) : setting.order;
    return std::min(order, double(request.corner_order));
  }

  // As the levels tell it.
  FallingErrors errors() const {
    FallingErrors told;
    for (const Level& l : levels) told.fineness.push_back(fineness(l));
    told.distances = distances;
    told.best = best_order();
    told.steady = steady();
    told.least = has_space() ? 0.3 : 0.5;
    told.unseen = steady()                      ? (has_space() ? told.best : slope_in_time())
                  : request.corner_distance > 0 ? 0.75 * told.best
                                                : told.best / 2;
    return told;
  }
  double rate(std::size_t k) const { return errors().rate(k); }
  double predicted(double at) const { return errors().predicted(at); }

  // ---- the climb ----

  // Few enough that hardly a request is met by them: they cost next to nothing. A grid that is set has one
  // level below.
  double first_cells() const {
    const Options& options = request.options;
    if (!request.grid_open) {
      const double set = cells_of(request.scene);
      return set / 2.25 < setting.order + 2 ? 1.5 * set : set / 2.25;
    }
    const std::string type = options.text("init_type");
    // few nodes come near each other by chance
    double count = request.corner_order <= 2 || runs.friction_sets_steps() ? 48 : 12;
    if (type == "sine") count *= std::max(1., options.real("init_mode"));
    if (type == "pulses" || type == "wave") count = 48 * options.real("init_pulses");
    if (type == "layer") count = std::max(count, 3 * request.scene.length / options.real("init_width"));
    if (request.corner_distance > 0)
      count = std::max(count, 0.8 * request.scene.length / request.corner_distance);
    if (runs.jump())
      count = std::max(count, runs.jump()->least_cells(setting.order, runs.at_start().t_end()));
    return std::floor(std::min(count, 1e5));
  }

  void choose() {
    if (!has_space() && !request.tolerance_open) {
      levels = {runs.run(request.scene.n, setting.tolerance / loosened)};
      return;
    }
    while (levels.size() < 2 || !place()) climb();
  }

  void begin_anew(double from = 0) {
    levels.clear();
    distances.clear();
    next = from;
  }

  // A level at this fineness; where it fails, one by the other method from the bottom, or on twice as fine a
  // grid.
  void climb() {
    if (next == 0) {
      tolerance = request.tolerance_open ? std::clamp(0.2 * share_of_time * aim, least_tolerance, 1e-4)
                                         : setting.tolerance;
      const double aimed = (setting.method.can().is_explicit ? 10 : 0.1) * aim;
      next = has_space() ? first_cells() : 1 / std::clamp(aimed, 1e-12, loosest());
    }
    try {
      add(has_space() ? runs.run(request.nodes(next), tolerance) : runs.run(request.scene.n, 1 / next));
    } catch (const OutOfReach&) {
      if (runs.take_other()) {
        begin_anew();
      } else if (!request.grid_open || ++failures == 6) {
        throw;
      } else {
        next *= 2;
      }
      return;
    }
    if (levels.size() > 1) return;
    const bool cheap = double(levels[0].steps) * double(levels[0].scene.n) < 5000;
    if (has_space())
      next = last() * (!request.grid_open && last() > cells_of(request.scene) ? 1 / 1.5 : cheap ? 2 : 1.5);
    else
      next = std::min(last() * (setting.method.can().is_explicit ? 1000 : 10), 1 / least_tolerance);
  }

  void add(Level made) {
    // the same steps, which only grew: the difference tells nothing
    if (!has_space() && !levels.empty() && made.steps == levels.back().steps) {
      if (made.tolerance <= 2 * least_tolerance) {
        least = 1 / made.tolerance;
      } else {
        levels.pop_back();
        if (!distances.empty()) distances.pop_back();
      }
    }
    if (!levels.empty()) {
      double d = runs.difference(levels.back(), made);
      if (request.of.is_number() && !distances.empty())
        d = std::max(d,
                     distances.back() * std::pow(fineness(levels[levels.size() - 2]) / last(), best_order()));
      distances.push_back(d);
    }
    levels.push_back(std::move(made));
  }

  // Where the run is to be, as the levels predict it.
  Ahead look_ahead() const {
    const std::size_t known = distances.size();
    const double best = best_order(), order = errors().order_beyond(),
                 wanted = aim * (!has_space()  ? share_alone
                                 : runs.jump() ? share_beside_jump
                                               : share_of_space);
    const double factor = std::max(std::pow(predicted(last()) / wanted, 1 / order), least / last());
    // an order that has hardly begun to rise predicts nothing
    const bool resolved = steady() || distances.back() < (known < 2 ? 20 : 3) * wanted ||
                          (known > 1 && rate(known - 1) > 0.25 * best);
    const bool sure = errors().order_between() > 0.8 * best;
    if (!has_space()) {
      const bool strictest = levels.back().tolerance <= 2 * least_tolerance;
      const double further =
          std::min(std::clamp(2 * lead() * factor, lead(), 1000.), 1 / least_tolerance / last());
      return {factor, further, factor < 1 / lead() || strictest};
    }
    const double reach = std::clamp(std::pow(telling, 1 / order), 1.3, sure ? 8. : 2.2);
    const double further = resolved ? std::clamp(factor / 1.45, 1.3, sure ? 4. : 2.) : 2;
    // near the last level the distance from it would tell nothing
    const double apart = factor > 0.93 ? std::max(factor, std::pow(0.4, -1 / order)) : factor;
    return {apart, further, !request.grid_open || (resolved && factor < reach)};
  }

  // Places the run where the levels predict it; false: says where the next level is to be.
  bool place() {
    const Ahead ahead = look_ahead();
    const double run = ahead.run * last();
    next = ahead.within ? run : ahead.next * last();
    if (has_space() ? runs.prefers_explicit(levels.back(), request.nodes(next), tolerance)
                    : runs.prefers_explicit(levels.back(), request.scene.n, 1 / run)) {
      runs.take_explicit();
      begin_anew();
    } else if (has_space() && ahead.within) {
      place_on_grid(run);
    } else if (has_space()) {
      check_reach(run);
    } else if (ahead.within) {
      place_in_time(1 / run);
    }
    return ahead.within && !levels.empty();
  }

  void place_in_time(double wish) {
    const double error = distances.back();
    if (levels.back().tolerance <= 2 * least_tolerance && error > aim && wish < levels.back().tolerance)
      give_up_in_time(levels.back().tolerance, error);
    setting.tolerance = std::clamp(wish, least_tolerance, 3 * loosest());
    in_time = predicted(1 / setting.tolerance);
  }

  void place_on_grid(double wanted) {
    if (request.grid_open) setting.n = request.nodes(wanted);
    const double cells = cells_of(on_grid(request.scene, setting.n, setting.order));
    if (request.grid_open && !affords(cells))
      give_up(fmt::format("the {} nodes that would do are beyond accuracy_seconds {}", setting.n,
                          request.options.text("accuracy_seconds")));
    in_space = predicted(cells);
    in_time = error_in_time(cells);
    setting.tolerance = tolerance;
    if (request.tolerance_open) {
      const double part = share_of_time * aim / in_time,
                   factor = part < 1 ? std::pow(part, 1 / slope_in_time()) : std::min(part, loosened);
      setting.tolerance = std::clamp(factor * tolerance, least_tolerance, std::max(tolerance, 1e-4));
      const double ratio = setting.tolerance / tolerance;
      in_time *= ratio < 1 ? std::pow(ratio, slope_in_time()) : ratio;
    }
    if (in_time > request.wanted) give_up_in_time(setting.tolerance, in_time);
  }

  // Whether a run on a grid of so many cells, with steps as short as they are, is within the time that is
  // left.
  bool affords(double cells) const {
    const double ratio = std::max(1., cells / last());
    return runs.affords(levels.back().seconds * ratio * ratio);
  }

  // Begins anew where it is the errors of steps that do not fall from grid to grid; else gives up where the
  // next level, or the run, cannot be had.
  void check_reach(double run) {
    const bool far = levels.back().scene.n > 2000 && run > double(most_nodes);
    const bool beyond_memory = next > double(most_nodes);
    if (!far && !beyond_memory && affords(next)) return;
    if (levels_tightened()) return;
    const Start::Misfit jump = runs.at_start().start().misfit(request.scene);
    const double misfit = std::max(std::abs(jump.left), std::abs(jump.right));
    if (far && misfit > 1e-8) give_up(fmt::format("the start jumps by {:.3g} at a held end", misfit));
    if (far && never_better()) give_up("four grids show the same");
    if (beyond_memory) give_up(fmt::format("no grid has more than {} nodes", most_nodes));
    if (!affords(next))
      give_up("a finer grid is beyond accuracy_seconds " + request.options.text("accuracy_seconds"));
  }

  // Whether the low rate of the last levels is there to stay, as at a corner: an error that is small already
  // and has fallen at one rate three times. Otherwise fronts may be about to be resolved, and the climb goes
  // on.
  bool never_better() const {
    const std::size_t known = distances.size();
    if (known < 4) return false;
    const auto [low, high] = std::minmax({rate(known - 3), rate(known - 2), rate(known - 1)});
    double largest = 0;
    for (const double psi : levels.back().answer.fields.psi) largest = std::max(largest, std::abs(psi));
    return high - low < 0.4 && high < 0.3 * best_order() && predicted(last()) < 0.01 * largest;
  }

  // What steps at the tolerance of the levels err by on a grid of so many cells, as looser ones on the grid
  // before the last tell.
  double error_in_time(double cells) {
    const Level& level = levels[levels.size() - 2];
    const double own_cells = cells_of(level.scene);
    if (tolerance != seen_in_time.tolerance || own_cells > 1.7 * seen_in_time.cells) {
      Level other = runs.run(level.scene.n, loosened * tolerance);
      // the same steps, which only grew: the difference tells nothing
      if (other.steps == level.steps)
        other = runs.run(level.scene.n, std::max(tolerance / 100, least_tolerance));
      const double looser = std::max(tolerance, other.tolerance),
                   error = std::max(runs.difference(level, other), 0.1 * looser);
      seen_in_time = {tolerance, own_cells, error * std::pow(tolerance / looser, slope_in_time())};
    }
    // on finer grids by more, as noise of the shortest waves does
    return seen_in_time.error * std::max(1., cells / seen_in_time.cells);
  }

  // Begins anew with stricter steps where those of the levels err by much of what their grids do.
  bool levels_tightened() {
    const double error = error_in_time(last());
    const double allowed = 0.3 * std::max(predicted(last()), share_of_space * aim);
    if (error <= allowed || !request.tolerance_open || ++restarts > 4) return false;
    const double part = std::min(share_of_time * aim / error, 0.1);
    tolerance = std::max(least_tolerance, tolerance * std::pow(part, 1 / slope_in_time()));
    begin_anew(cells_of(levels[levels.size() - 2].scene));
    return true;
  }

  // ---- what cannot be had ----

  // Where the solution jumps, or friction jumps or bends.
  std::string profile_word() const {
    const std::string of = request.scene.medium.varies() ? "what differs " : "friction ";
    return of + (request.corner_order == 1 ? "jumps" : "bends");
  }

  [[noreturn]] void give_up(const std::string& limit) const {
    const double seen = distances.size() > 1 ? rate(distances.size() - 1) : NAN;
    throw OutOfReach{
        fmt::format("on {} nodes the error is about {:.2g} and {}, as it does at {}{}; {}",
                    levels.back().scene.n, predicted(last()),
                    seen < 0.3 ? "does not fall from grid to grid" : fmt::format("falls like h^{:.2g}", seen),
                    request.corner_order <= 2 ? "places where " + profile_word() + " and " : "",
                    seen < 0.3 * best_order() ? "jumps, corners and fronts thinner than that grid"
                                              : "fronts that are not resolved",
                    limit)};
  }

  [[noreturn]] void give_up_in_time(double at, double error) const {
    throw OutOfReach{fmt::format(
        "at tolerance {:.2g} the error in time is still about {:.2g} ({})", at, error,
        request.tolerance_open ? "the motion amplifies what is lost" : "ts_rtol, ts_atol as set")};
  }

  // The best level is run all the same.
  void confirm() {
    if (distances.empty()) throw Failure(refusal);
    setting.n = levels.back().scene.n;
    setting.tolerance = levels.back().tolerance;
    (has_space() ? in_space : in_time) = predicted(last());
  }

  // ---- the run ----

  // From its distance to the last level, of which it has so many times the fineness; a little above.
  double error_of_run(double distance, double ratio) const {
    if (distances.empty()) return 1.2 * distance;
    const std::size_t known = distances.size();
    const double p = best_order(), of_last = predicted(last());
    double order = errors().order_beyond(), error = of_last;
    if (ratio < 0.97) {
      const double slow = known > 1 ? std::clamp(rate(known - 1), 0.5, p) : order;
      error = std::max(distance / (1 - std::pow(ratio, slow)), 0.3 * predicted(ratio * last()));
    }
    for (int round = 0; ratio > 1.03 && round < 3; ++round) {
      // two grids that are close may err alike
      const double seen =
          std::max(distance / (1 - std::pow(ratio, -order)), ratio < 1.5 ? 0.6 * of_last : 0.);
      const double rate_seen =
          std::log(distances.back() / seen) / std::log(last() / fineness(levels[known - 1]));
      if (!steady()) order = expected_order(known > 1 ? rate(known - 1) : NAN, rate_seen, p);
      error = seen * std::pow(ratio, -order);
    }
    if (!has_space()) return (scatters() ? 1.3 : 1.15) * error;
    // Where corners set the order the constant changes from grid to grid, with the places of the nodes beside
    // them; else more goes otherwise than predicted far from the best order.
    const bool corners = p < setting.order && !runs.jump();
    return (corners ? 2 : 1.3 + 1.5 * (1 - order / p)) * error;
  }

  double estimate(const Answer& end) {
    last_run = {has_space() ? on_grid(request.scene, setting.n, setting.order) : request.scene,
                setting.tolerance,
                end,
                0,
                0,
                0};
    double d = runs.difference(levels.back(), last_run, last_run.scene.n >= levels.back().scene.n);
    // a single number may come near by chance
    if (request.of.is_number() && !distances.empty()) d = std::max(d, 0.3 * predicted(last()));
    last_estimate = error_of_run(d, fineness(last_run) / last()) + (has_space() ? 1.5 * in_time : 0);
    return last_estimate;
  }

  // Makes the setting stricter, for the run of the last estimate.
  void refine() {
    const bool space = has_space() && last_estimate - 1.5 * in_time > 0.5 * request.wanted;
    const std::string about = fmt::format(" as set the error is about {:.2g}", last_estimate);
    if (space && !request.grid_open) throw OutOfReach{fmt::format("on grid_n {}{}", setting.n, about)};
    if (!space && !request.tolerance_open)
      throw OutOfReach{fmt::format("at the tolerance {:.2g}{}", setting.tolerance, about)};
    if (!has_space() && setting.tolerance <= 2 * least_tolerance)
      give_up_in_time(setting.tolerance, last_estimate);
    aim *= 0.7;
    const double run = fineness(last_run);
    const double order = errors().order_beyond();
    const double stretch = std::pow(last_estimate / (share_alone * request.wanted), 1 / order);
    least = run * (has_space() ? std::clamp(stretch, 1., 2.) : std::max(2., stretch));
    if (has_space() && !space) {
      tolerance = std::max(least_tolerance, 0.1 * tolerance);
      begin_anew(fineness(levels[levels.size() - 2]));
    } else if (!(has_space() && levels_tightened()) && run > 1.03 * last()) {
      if (levels.size() > 2 && run < 1.3 * last()) {  // too close to tell
        levels.pop_back();
        distances.pop_back();
      }
      add(last_run);
    }
    choose();
  }

  void finish() {
    const Options& asked = request.options;
    chosen = has_space() ? options_for(asked, setting) : asked;
    if (!setting.method.can().splits || setting.method.implicit != "auto")
      chosen = chosen.with("imex_implicit", setting.method.implicit);
    const auto set = [&](const std::string& name, const std::string& value) {
      if (!asked.is_set(name)) chosen = chosen.with(name, value);
    };
    set("ts_type", setting.method.type);
    if (const std::string sub = setting.method.can().subtype_option; !sub.empty())
      set(sub, setting.method.subtype);
    if (const double step = runs.at_start().longest_step(setting); step > 0)
      set("ts_adapt_dt_max", number_text(step));
    set("ts_rtol", number_text(setting.tolerance));
    set("ts_atol", "auto:" + number_text(setting.tolerance));
    what = setting.method.name();
    if (setting.method.can().splits) what += " (implicit: " + setting.method.implicit + ")";
    what += fmt::format(", tolerance {:.2g}", setting.tolerance);
    if (has_space()) what += fmt::format(", order {}, n = {}", setting.order, setting.n);
    what += fmt::format(", after {} short runs", runs.count());
    if (!distances.empty()) what += fmt::format("; error predicted in time {:.2g}", in_time);
    if (has_space() && !distances.empty())
      what += fmt::format(", in space {:.2g} (falling like h^{:.2g}{})", in_space, errors().order_between(),
                          request.corner_order <= 2 ? ", as " + profile_word() + " along x" : "");
    if (!runs.why().empty()) what += "; " + runs.why();
  }
};

// ---- the plan ----

AccuracyPlan::AccuracyPlan(const Options& options, double wanted)
    : impl_(std::make_unique<Impl>(options, wanted)) {
  warn_of_pieces(impl_->request.scene);
  impl_->timed([&] {
    impl_->runs.choose_method(share_of_time * wanted);
    try {
      impl_->choose();
    } catch (const OutOfReach& e) {
      impl_->refusal = impl_->out_of_reach(e);
      impl_->confirm();
    }
  });
  impl_->finish();
}
AccuracyPlan::~AccuracyPlan() = default;

const Options& AccuracyPlan::options() const { return impl_->chosen; }
const std::string& AccuracyPlan::what() const { return impl_->what; }
const std::string& AccuracyPlan::refusal() const { return impl_->refusal; }
const Setting& AccuracyPlan::setting() const { return impl_->setting; }
double AccuracyPlan::seconds() const { return impl_->seconds; }
int AccuracyPlan::trials() const { return impl_->runs.count(); }

MeasureMaker AccuracyPlan::measure() const { return impl_->request.of.measure(impl_->request.options); }

std::vector<double> AccuracyPlan::value(const Answer& end) const {
  const AccuracyRequest& request = impl_->request;
  if (request.of.kind != Quantity::Kind::probe) return end.measured;
  const Fields at = at_points(end.fields, Scene::from(impl_->chosen, false), request.probes);
  return {at.psi[0], at.eta[0]};
}

std::optional<JumpAtEnd> AccuracyPlan::jump() {
  const std::optional<Jump>& jump = impl_->runs.jump();
  if (!jump) return std::nullopt;
  return impl_->timed([&]() -> std::optional<JumpAtEnd> {
    const Scene grid = Scene::from(impl_->chosen, false);
    const double t = impl_->runs.at_start().t_end();
    const Jump::Extent left_out = jump->extent(grid, t);
    return JumpAtEnd{jump->x(t), jump->height(impl_->request.options, impl_->setting),
                     std::max(0., left_out.from), std::min(grid.length, left_out.to)};
  });
}

double AccuracyPlan::estimate(const Answer& end) {
  if (impl_->request.of.is_measured() && end.measured.empty())
    throw Failure("accuracy_of " + impl_->request.options.text("accuracy_of") + ": " +
                  impl_->request.of.missing());
  return impl_->timed([&] { return impl_->estimate(end); });
}

void AccuracyPlan::refine() {
  try {
    impl_->timed([&] { impl_->refine(); });
  } catch (const OutOfReach& e) {
    throw Failure(impl_->out_of_reach(e));
  }
  impl_->finish();
}

}  // namespace stickslip
