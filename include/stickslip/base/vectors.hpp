// Objects of PETSc that end by themselves, the values of its vectors, and how ranks exchange them.
#pragma once

#include <petscdm.h>
#include <petscsys.h>
#include <petscts.h>
#include <petscvec.h>

#include <cstdint>
#include <functional>
#include <type_traits>
#include <utility>
#include <vector>

#include "stickslip/base/error.hpp"

namespace stickslip {

// Move-only owners of PETSc objects: destroyed with the scope, also when an exception passes.
template <class T, PetscErrorCode (*destroy)(T*)>
class Handle {
 public:
  Handle() = default;
  explicit Handle(T object) : object_(object) {}
  Handle(Handle&& other) noexcept : object_(std::exchange(other.object_, nullptr)) {}
  Handle& operator=(Handle&& other) noexcept {
    std::swap(object_, other.object_);
    return *this;
  }
  Handle(const Handle&) = delete;
  Handle& operator=(const Handle&) = delete;
  ~Handle() {
    if (object_) (void)destroy(&object_);
  }
  operator T() const { return object_; }  // NOLINT: a handle stands for its object
  T get() const { return object_; }
  T* out() { return &object_; }  // where a PETSc XxxCreate writes the new object

 private:
  T object_ = nullptr;
};

using VecHandle = Handle<Vec, VecDestroy>;
using MatHandle = Handle<Mat, MatDestroy>;
using DmHandle = Handle<DM, DMDestroy>;
using TsHandle = Handle<TS, TSDestroy>;
using SnesHandle = Handle<SNES, SNESDestroy>;
using KspHandle = Handle<KSP, KSPDestroy>;
using IsHandle = Handle<IS, ISDestroy>;
using ScatterHandle = Handle<VecScatter, VecScatterDestroy>;

// The part of a vector that this rank holds, as an array, for as long as the object lives; null of no vector.
// The vector is not to be used otherwise meanwhile. Not collective.
template <class T>  // const double to read, double to write
class LocalArray {
 public:
  explicit LocalArray(Vec v) : vec_(v) {
    if (!vec_) return;
    if constexpr (std::is_const_v<T>)
      SS_TRY(VecGetArrayRead(vec_, &data_));
    else
      SS_TRY(VecGetArray(vec_, &data_));
  }
  LocalArray(LocalArray&& other) noexcept : vec_(std::exchange(other.vec_, nullptr)), data_(other.data_) {}
  ~LocalArray() {
    if (!vec_) return;
    if constexpr (std::is_const_v<T>)
      (void)VecRestoreArrayRead(vec_, &data_);
    else
      (void)VecRestoreArray(vec_, &data_);
  }
  LocalArray(const LocalArray&) = delete;
  LocalArray& operator=(const LocalArray&) = delete;
  operator T*() const { return data_; }  // NOLINT: it stands for its values

 private:
  Vec vec_;
  T* data_ = nullptr;
};

using Reading = LocalArray<const double>;
using Writing = LocalArray<double>;

// A copy of the part of a vector that this rank holds. Not collective.
inline std::vector<double> local_values(Vec v) {
  PetscInt count;
  SS_TRY(VecGetLocalSize(v, &count));
  const Reading own(v);
  return std::vector<double>(own + 0, own + count);
}

// Numbers of nodes of a grid that is spread over ranks, wherever these nodes lie: the halo of a stencil, the
// places of a probe, a piece of the grid with what lies beside it.
class NodeFetch {
 public:
  // How a vector lies on the ranks: each has `local` nodes of `all`, in order, with `dof` numbers a node.
  struct Layout {
    MPI_Comm comm;
    PetscInt local, all;
    int dof;
  };
  // The first `kept` numbers of each of `nodes`, counted from 0 over all ranks, in any order and as often as
  // each is wanted here. Collective.
  NodeFetch(const Layout& layout, int kept, const std::vector<PetscInt>& nodes);

  bool is_local() const { return !scatter_; }  // one rank has all nodes: nothing is sent
  // The values now, from this rank's part of such a vector; in two steps, the first of which only asks, and
  // `own` is not to change between them. Collective.
  void begin(const double* own) const;
  void end() const;
  void take(const double* own) const {
    begin(own);
    end();
  }
  void take(Vec u) const;

  // As they were taken last, node after node.
  const double* values() const { return values_.data(); }
  Vec vector() const { return fetched_; }  // over the same

 private:
  int dof_, kept_;
  std::vector<PetscInt> nodes_;  // where nothing is sent
  mutable std::vector<double> values_;
  VecHandle own_, fetched_;  // own_: over what is given
  ScatterHandle scatter_;
};

// Long lists between rank 0, which reads and writes files, and those that have parts of them: in pieces of at
// most a megabyte, so that rank 0 has no more of the others' parts at a time.
constexpr std::int64_t largest_piece = 1 << 17;  // doubles: a megabyte

// Every rank gets the values first ... first + count - 1 of a list that rank 0 reads by read(first, count,
// values). Parts may overlap. What read() throws every rank throws (root.hpp). Collective.
void scatter(MPI_Comm comm, std::int64_t first, std::int64_t count, double* into,
             const std::function<void(std::int64_t first, std::int64_t count, double* values)>& read);

// The values first ... first + count - 1 of `rows` rows, one row behind the other, of list number `list`.
struct Piece {
  std::int64_t list = 0, row = 0, rows = 1, first = 0, count = 0;
};
using Give = std::function<void(const Piece& piece, const double* values)>;

// The other way: what body(give) gives on every rank is handed to write() on rank 0, first what that one
// gives itself. What any of them throws every rank throws. Collective.
void collect(MPI_Comm comm, const std::function<void(const Give&)>& body, const Give& write);

}  // namespace stickslip
