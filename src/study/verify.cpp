// Checks of the boundary by time integration of the full system on both sides of it.
#include <algorithm>
#include <cmath>

#include "stickslip/boundary.hpp"
#include "stickslip/error.hpp"
#include "stickslip/model.hpp"
#include "stickslip/time.hpp"

namespace stickslip {

namespace {

// A start about steady sliding: psi_i = steady + amplitude (1 + cos(k x))/2 at the nodes solved for, eta and state steady.
void start_beside(const Model& model, const Sliding& s, double amplitude, double k, Vec u) {
  PetscScalar* x;
  SS_TRY(VecGetArray(u, &x));
  const std::size_t d = std::size_t(model.dof());
  for (PetscInt i = 0; i < model.local(); ++i) {
    const std::size_t g = std::size_t(model.first() + i), at = std::size_t(i) * d;
    const bool held = model.held(model.first() + i);
    x[at] = s.psi[g] + (held ? 0 : amplitude * (0.5 + 0.5 * std::cos(k * s.scene.x(PetscInt(g)))));
    x[at + 1] = s.eta[g];
    if (d == 3) x[at + 2] = s.state[g];
  }
  SS_TRY(VecRestoreArray(u, &x));
}

double deviation(const Model& model, const Sliding& s, Vec u) {
  const PetscScalar* x;
  SS_TRY(VecGetArrayRead(u, &x));
  double largest = 0;
  for (PetscInt i = 0; i < model.local(); ++i)
    largest = std::max(largest, std::abs(x[i * model.dof()] - s.psi[std::size_t(model.first() + i)]));
  SS_TRY(VecRestoreArrayRead(u, &x));
  SS_TRY(MPI_Allreduce(MPI_IN_PLACE, &largest, 1, MPI_DOUBLE, MPI_MAX, model.comm()));
  return largest;
}

}  // namespace

// The method is the program's own choice for the scene, adaptive and accurate: the user's -ts_ options do not reach it,
// since a damping method with long steps would make sliding look stable (docs/spectrum.md).
std::string regime_from(const Options& options, const Sliding& s, double amplitude, double k, double duration) {
  const Model model(PETSC_COMM_WORLD, Scene::from(options, false));
  VecHandle u = model.create_vector();
  start_beside(model, s, amplitude, k, u);
  Integrator integrator(model, options, u, "verify_");
  double late = 0, early = 0;  // largest deviation in the last fifth, and in the fifth before it
  integrator.advance(u, 0, duration, [&](const Integrator::Step& step) {
    if (step.t > 0.8 * duration) late = std::max(late, deviation(model, s, step.u));
    else if (step.t > 0.6 * duration) early = std::max(early, deviation(model, s, step.u));
    return Integrator::Verdict::go_on;
  });
  const double scale = std::max(1., std::abs(s.scene.v));
  if (late < 1e-3 * scale || late < 0.7 * early) return "sliding";       // gone, or on its way
  if (late > 0.05 * scale || late > 1.4 * early) return "stick-slip";
  return "undecided";
}

std::vector<Verified> verify_boundary(GrowthRate& growth, const std::vector<Crossing>& points, PetscInt count,
                                      const std::function<void(std::size_t, std::size_t)>& before_each) {
  std::vector<Verified> result;
  const std::size_t wanted = std::min(points.size(), std::size_t(count));
  const bool two = growth.axes().size() > 1;
  for (std::size_t j = 0; j < wanted; ++j) {
    const Crossing& c = points[wanted == 1 ? points.size() / 2 : j * (points.size() - 1) / (wanted - 1)];
    // across the curve: the direction in which the growth rate changes
    const double step = 1e-4;
    const auto difference = [&](double dx, double dy) {
      const auto in = [](double t) { return std::clamp(t, 0., 1.); };
      return growth(in(c.x + dx), in(c.y + dy)) - growth(in(c.x - dx), in(c.y - dy));
    };
    double nx = difference(step, 0), ny = two ? difference(0, step) : 0;
    const double length = std::hypot(nx, ny);
    if (!(length > 0)) continue;
    nx /= length;
    ny /= length;
    for (const double side : {1., -1.}) {  // unstable, stable
      if (before_each) before_each(2 * j + (side > 0 ? 0 : 1), 2 * wanted);
      // as far off as gives a growth rate that shows in a run of reasonable length
      for (double reach = 0.02;; reach *= 1.6) {
        const double x = c.x + side * reach * nx, y = c.y + side * reach * ny;
        if (x < 0 || x > 1 || y < 0 || y > 1 || reach > 0.3) break;
        const auto at = growth.leading(x, y);
        if (!at || std::abs(at->mode.value.real()) < 0.01 * (at->mode.value.imag() + 0.1)) continue;
        const Options options = growth.options_at(x, y);
        const Sliding s(Scene::from(options, true));
        const double rate = std::abs(at->mode.value.real()), duration = std::min(3000., 9 / rate + 60);
        const double k = at->mode.wavenumber > 0 ? at->mode.wavenumber
                         : s.scene.ring()       ? 2 * M_PI / s.scene.length
                                                : M_PI / s.scene.length;
        Verified v;
        v.value = growth.axes()[0].value(x);
        v.value2 = two ? growth.axes()[1].value(y) : 0;
        v.growth = at->mode.value.real();
        v.expected = side > 0 ? "stick-slip" : "sliding";
        v.from_sliding = regime_from(options, s, 0.01, k, duration);
        v.from_stick_slip = regime_from(options, s, 2 * std::max(1., std::abs(s.scene.v)), k, duration);
        v.regime = v.from_sliding == v.from_stick_slip                                     ? v.from_sliding
                   : v.from_sliding == "sliding" && v.from_stick_slip == "stick-slip" ? "both live"
                                                                                          : "undecided";
        result.push_back(v);
        break;
      }
    }
  }
  return result;
}

}  // namespace stickslip
