// The loops of loops.hpp, compiled for each law: each kind in a file of its own.
#pragma once

#include "model/dispatch.hpp"
#include "model/loops.hpp"

namespace stickslip {

using PointwiseFamily = LoopFamily<PointwiseLoop, kernel::PointwiseOfColumns>;
using StageFamily = LoopFamily<StageLoop, kernel::SolveStage>;
using NewtonFamily = LoopFamily<NewtonLoop, kernel::NewtonRound>;
using TangentFamily = LoopFamily<TangentLoop, kernel::TangentsOfColumns>;
extern template LawTable<PointwiseFamily::Make>& PointwiseFamily::table();
extern template LawTable<StageFamily::Make>& StageFamily::table();
extern template LawTable<NewtonFamily::Make>& NewtonFamily::table();
extern template LawTable<TangentFamily::Make>& TangentFamily::table();

}  // namespace stickslip
