// The loops of tile_kernels.hpp, compiled for each law.
#pragma once

#include "model/dispatch.hpp"
#include "time/tile_kernels.hpp"

namespace stickslip::tile {

using PointwiseFamily = LoopFamily<Pointwise, kernel::PointwiseOfColumns>;
using SolveStageFamily = LoopFamily<SolveStage, kernel::SolveStage>;
using NewtonRoundFamily = LoopFamily<NewtonRound, kernel::NewtonRound>;
using TangentsFamily = LoopFamily<NodeTangents, kernel::TangentsOfColumns>;

}  // namespace stickslip::tile

namespace stickslip {

template <>
LawTable<tile::PointwiseFamily::Make>& tile::PointwiseFamily::table();
template <>
LawTable<tile::SolveStageFamily::Make>& tile::SolveStageFamily::table();
template <>
LawTable<tile::NewtonRoundFamily::Make>& tile::NewtonRoundFamily::table();
template <>
LawTable<tile::TangentsFamily::Make>& tile::TangentsFamily::table();

}  // namespace stickslip
