#include "stickslip/numerics/direct_ksp.hpp"

#include "base/broadcast.hpp"
#include "stickslip/base/error.hpp"

namespace stickslip {

namespace {
PC direct_pc(KSP ksp) {
  SS_TRY(KSPSetType(ksp, KSPPREONLY));
  PC pc;
  SS_TRY(KSPGetPC(ksp, &pc));
  return pc;
}

bool is_distributed(KSP ksp) { return ranks_in(PetscObjectComm(reinterpret_cast<PetscObject>(ksp))) > 1; }
}  // namespace

void solve_by_banded_lu(KSP ksp) {
  PC pc = direct_pc(ksp);
  if (is_distributed(ksp)) {
    SS_TRY(PCSetType(pc, PCREDUNDANT));
    KSP inner;
    SS_TRY(PCRedundantGetKSP(pc, &inner));
    SS_TRY(KSPGetPC(inner, &pc));
  }
  SS_TRY(PCSetType(pc, PCLU));
  SS_TRY(PCFactorSetMatOrderingType(pc, MATORDERINGNATURAL));
}

// PCPBJACOBI, which is made for this, keeps the inverses of the first values that a matrix had: in PETSc from
// 3.20 on those of a BAIJ, in 3.25 of an AIJ as well.
void solve_by_blocks(KSP ksp) {
  SS_TRY(PCSetType(direct_pc(ksp), is_distributed(ksp) ? PCBJACOBI : PCILU));
}

}  // namespace stickslip
