// Eight numbers at once, one in each lane of a vector: what is written once for them is done in registers of
// any width, lane by lane in the same order, so that each lane has the same bits whatever instructions run.
#pragma once

namespace stickslip::kernel {

constexpr int lanes = 8;

// Eight values, as they lie among others. Clang takes what a reference leads to for aligned whatever the type
// says: so memory is spoken of by pointers, and values have a type of their own there.
typedef double LanesInMemory __attribute__((vector_size(64), aligned(8), may_alias));
#if defined(__clang__)
typedef double Lanes __attribute__((vector_size(64)));
#else
typedef LanesInMemory Lanes;
#endif
inline const LanesInMemory* lanes_at(const double* a) { return reinterpret_cast<const LanesInMemory*>(a); }
inline LanesInMemory* lanes_at(double* a) { return reinterpret_cast<LanesInMemory*>(a); }

}  // namespace stickslip::kernel
