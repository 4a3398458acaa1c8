#include "model/loops.hpp"

#include <algorithm>

#include "model/dispatch.hpp"

namespace stickslip {

namespace {

// The laws that cost less than a column of theirs.
using Cheap = Types<Cubic>;

// Calls make(source, medium) with the classes that say what friction and the nodes' coefficients are.
template <class Loop, class Make>
Loop with_source(const FrictionParameters& p, bool sticking, const FrictionPlaces& places, const Make& make) {
  Loop loop;
  for_each_type(Cheap(), [&](auto law) {
    using L = typename decltype(law)::type;
    if (p.law->name != L::name || p.has_state() || !places.empty()) return;
    loop = with_friction<L, NoState>(p, [&](const auto& friction) {
      using F = std::decay_t<decltype(friction)>;
      return with_flags(
          [&](auto sticks, auto smoothed) -> Loop {
            if constexpr ((sticks && !F::sticks) || (smoothed && !jumps_at_rest<L>()))
              throw std::logic_error("law " + p.law->name + " does not stick");
            else
              return make(kernel::Within<F, sticks, smoothed>{friction}, kernel::SameMedium());
          },
          sticking, jumps_at_rest<L>() && p.regularised);
    });
  });
  if (loop) return loop;
  const kernel::LawColumns law = kernel::law_columns(p, sticking, places);
  std::vector<NodeCoefficients> medium;
  for (const FrictionPlace& place : places)
    if (place.medium) medium.push_back(*place.medium);
  return with_flags(
      [&](auto state, auto steep, auto sticks) -> Loop {
        if constexpr (steep && (sticks || !state)) {
          throw std::logic_error("no law is like this");
        } else {
          const kernel::ByColumns<state, steep, sticks> source{law};
          if (medium.empty()) return make(source, kernel::SameMedium());
          return make(source,
                      kernel::OwnMedium{std::make_shared<const std::vector<NodeCoefficients>>(medium)});
        }
      },
      law.has_state, law.steep, sticking);
}

// A loop where nodes have coefficients of their own is no vector code.
template <class Loop, class Kernel>
Loop version_of(const Kernel& kernel, const kernel::SameMedium&) {
  return kernel::compiled<Loop>(kernel);
}
template <class Loop, class Kernel>
Loop version_of(const Kernel& kernel, const kernel::OwnMedium&) {
  return kernel::Baseline<Kernel>{kernel};
}

}  // namespace

template <>
PointwiseLoop loop_for(const FrictionParameters& p, bool sticking, const FrictionPlaces& places) {
  return with_source<PointwiseLoop>(p, sticking, places, [](const auto& source, const auto& medium) {
    using Kernel = kernel::PointwiseOfColumns<std::decay_t<decltype(source)>, std::decay_t<decltype(medium)>>;
    return version_of<PointwiseLoop>(Kernel{source, medium}, medium);
  });
}
template <>
StageLoop loop_for(const FrictionParameters& p, bool sticking, const FrictionPlaces& places) {
  return with_source<StageLoop>(p, sticking, places, [](const auto& source, const auto& medium) {
    using Kernel = kernel::SolveStage<std::decay_t<decltype(source)>, std::decay_t<decltype(medium)>>;
    return version_of<StageLoop>(Kernel{source, medium}, medium);
  });
}
template <>  // bands have the same coefficients everywhere
NewtonLoop loop_for(const FrictionParameters& p, bool sticking, const FrictionPlaces& places) {
  return with_source<NewtonLoop>(p, sticking, places, [](const auto& source, const auto&) {
    return kernel::compiled<NewtonLoop>(kernel::NewtonRound<std::decay_t<decltype(source)>>{source});
  });
}

ForceLoop force_loop(const FrictionParameters& p, const FrictionPlaces& places) {
  return [law = kernel::law_columns(p, false, places)](PetscInt node, PetscInt count, const double* psi,
                                                       const double* state, double* F) {
    double unused[kernel::tile_size];
    for (PetscInt begin = 0; begin < count; begin += kernel::tile_size)
      law.rates({psi + begin, state ? state + begin : nullptr, nullptr,
                 std::min(kernel::tile_size, count - begin), node + begin},
                {F + begin, nullptr, nullptr, unused, nullptr, nullptr});
  };
}

StencilLoop stencil_loop(const Scene& scene, const std::vector<double>& links) {
  if (!links.empty())
    return kernel::compiled<StencilLoop>(
        kernel::StencilOfLinks{std::make_shared<const std::vector<double>>(links)});
  return kernel::for_half_width(scene.order / 2, [](auto half_width) {
    return kernel::compiled<StencilLoop>(kernel::StencilOfColumns<half_width>{});
  });
}

PointwiseLoop frictionless_loop(int dof, const std::vector<NodeCoefficients>& medium) {
  return with_flags(
      [&](auto state) -> PointwiseLoop {
        using Source = kernel::NoFriction<state>;
        if (medium.empty()) return kernel::compiled<PointwiseLoop>(kernel::PointwiseOfColumns<Source>{});
        using Kernel = kernel::PointwiseOfColumns<Source, kernel::OwnMedium>;
        return Kernel{{}, {std::make_shared<const std::vector<NodeCoefficients>>(medium)}};
      },
      dof == 3);
}

kernel::Coefficients kernel::varied_coefficients(const Scene& scene, double factor) {
  Coefficients c = coefficients_with(scene.averaged(), factor);
  const auto drop = [&](const char* name, double& value) {
    if (scene.medium.profile(name)) value = std::nan("");
  };
  drop("model_m", c.A);
  drop("model_zeta", c.B);
  drop("model_k0", c.K0);
  drop("model_delta", c.s_delta);
  for (double& w : c.w)
    for (const char* name : {"model_k1", "model_c"}) drop(name, w);
  return c;
}

}  // namespace stickslip
