// The part of a vector that this rank holds, as an array, for as long as the object lives; null of no vector.
// The vector is not to be used otherwise meanwhile. Not collective.
#pragma once

#include <petscvec.h>

#include <type_traits>
#include <utility>

#include "stickslip/base/error.hpp"

namespace stickslip {

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

}  // namespace stickslip
