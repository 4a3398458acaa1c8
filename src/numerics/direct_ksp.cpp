#include "stickslip/numerics/direct_ksp.hpp"

#include "stickslip/base/error.hpp"

namespace stickslip {

void solve_by_banded_lu(KSP ksp) {
  SS_TRY(KSPSetType(ksp, KSPPREONLY));
  PC pc;
  SS_TRY(KSPGetPC(ksp, &pc));
  int ranks;
  MPI_Comm_size(PetscObjectComm(reinterpret_cast<PetscObject>(ksp)), &ranks);
  if (ranks > 1) {
    SS_TRY(PCSetType(pc, PCREDUNDANT));
    KSP inner;
    SS_TRY(PCRedundantGetKSP(pc, &inner));
    SS_TRY(KSPGetPC(inner, &pc));
  }
  SS_TRY(PCSetType(pc, PCLU));
  SS_TRY(PCFactorSetMatOrderingType(pc, MATORDERINGNATURAL));
}

}  // namespace stickslip
