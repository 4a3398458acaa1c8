// Move-only owners of PETSc objects: destroyed with the scope, also when an exception passes.
#pragma once

#include <petscdm.h>
#include <petscts.h>

#include <utility>

namespace stickslip {

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

}  // namespace stickslip
