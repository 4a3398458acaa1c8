// The map of stable and unstable trains in docs/waves.md: growth rate over the wavelength of a pulse and the plate
// velocity, gamma = 3, delta = 0.2, both signs (argument `d` or `p`: one of them). One line a train: alone on its
// ring, and endless.
#include <slepceps.h>

#include <cstdio>

#include "stickslip/base/error.hpp"
#include "stickslip/waves/wave_stability.hpp"

using namespace stickslip;

int main(int argc, char** argv) {
  if (SlepcInitialize(&argc, &argv, nullptr, nullptr)) return 1;
  install_error_handler();
  const char only = argc > 1 ? argv[1][0] : 'b';
  for (const bool derived : {true, false}) {
    if (only == (derived ? 'p' : 'd')) continue;
    Scene scene;
    scene.derived_sign = derived;
    std::printf("# sign %s: v, length of a pulse, speed, growth alone on its ring, growth of the endless train, its "
                "wavenumber, complete\n",
                derived ? "derived" : "printed");
    for (const double v : {0., .3, .5, .7, .8, .85, .9, .93, .95, 1.}) {
      scene.v = v;
      for (const double length : {6., 7.5, 10., 15., 25., 50.}) {
        try {
          const Train train = solve_train(scene, {1, length, {}});
          const TrainSpectrum s = train_spectrum(train, 4);
          std::printf("%5.2f %5.1f %9.5f %+10.6f %+10.6f %8.4f %d\n", v, length, train.speed, s.growth_rate,
                      s.endless_stable ? 0. : s.endless_growth, s.endless_wavenumber, int(s.complete));
        } catch (const Error& e) {
          std::printf("%5.2f %5.1f %s\n", v, length, e.what());
        }
        std::fflush(stdout);
      }
    }
  }
  return SlepcFinalize() ? 1 : 0;
}
