#include "stickslip/study/stick_slip_end.hpp"

#include <algorithm>
#include <cmath>

#include "stickslip/base/error.hpp"
#include "stickslip/stability/boundary.hpp"
#include "study/branch_end.hpp"
#include "study/graze_end.hpp"

namespace stickslip {

std::string StickSlipEnd::refusal(const Scene& s) {
  if (s.massless())
    return "without mass (model_m 0) a block rests and slides without a jump, and no slip is thrown";
  if (s.spread != 0) return "friction_spread makes nodes move differently";
  if (s.has_profile()) return "a profile of friction makes nodes move differently";
  if (s.left == End::velocity || s.right == End::velocity) return "a held end makes nodes move differently";
  if (!(s.K0() > 0)) return "nothing loads the blocks (model_k0 0)";
  return "";
}

std::unique_ptr<StickSlipEnd> StickSlipEnd::of(SceneAt scene_at, std::vector<Axis> axes,
                                               const CellMotion& cell) {
  const Scene middle = scene_at(axes[0].value(.5), axes.size() > 1 ? axes[1].value(.5) : 0);
  if (!cell.cell && middle.friction.sticks())
    return std::make_unique<GrazeEnd>(std::move(scene_at), std::move(axes));
  return std::make_unique<BranchEnd>(std::move(scene_at), std::move(axes), cell);
}

Crossing StickSlipEnd::crossing_at(double x, double y) const {
  Crossing c = OnAxes::crossing_at(x, y);
  c.of = "stick-slip";
  c.growth = c.residual = std::nan("");
  return c;
}

std::string StickSlipEnd::place_text(double x, double y) const { return stickslip::place_text(axes_, x, y); }

void StickSlipEnd::note_stuck_ends(const std::vector<CurvePiece>& pieces,
                                   std::vector<std::string>& notes) const {
  note_stuck("the line of ends of stick-slip", "is found", axes_, pieces, notes);
}

bool StickSlipEnd::lives_nowhere() const {
  return !samples_.empty() && std::none_of(samples_.begin(), samples_.end(), [](double f) { return f <= 0; });
}

}  // namespace stickslip
