// Values of rank 0 given to every rank. Collective on PETSC_COMM_WORLD.
#pragma once

#include <petscsys.h>

#include <algorithm>
#include <cstdint>
#include <map>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

namespace stickslip {

template <class T>
std::enable_if_t<std::is_trivially_copyable_v<T>> broadcast(T& value) {
  MPI_Bcast(&value, static_cast<int>(sizeof value), MPI_BYTE, 0, PETSC_COMM_WORLD);
}

template <class T>
std::enable_if_t<std::is_trivially_copyable_v<T>> broadcast(std::vector<T>& values) {
  std::int64_t size = static_cast<std::int64_t>(values.size());
  broadcast(size);
  values.resize(static_cast<std::size_t>(size));
  const std::int64_t most = 1 << 26;  // an int counts the bytes of one call
  for (std::int64_t at = 0; at < size; at += most)
    MPI_Bcast(values.data() + at, static_cast<int>(std::min(most, size - at) * std::int64_t(sizeof(T))), MPI_BYTE, 0,
              PETSC_COMM_WORLD);
}

inline void broadcast(std::string& text) {
  std::vector<char> bytes(text.begin(), text.end());
  broadcast(bytes);
  text.assign(bytes.begin(), bytes.end());
}

template <class T>
void broadcast(std::map<std::string, T>& values) {
  std::int64_t size = static_cast<std::int64_t>(values.size());
  broadcast(size);
  auto source = values.begin();  // rank 0 has one for each, the others none
  for (std::int64_t k = 0; k < size; ++k) {
    std::pair<std::string, T> item;
    if (source != values.end()) item = *source++;
    broadcast(item.first);
    broadcast(item.second);
    values.insert(std::move(item));
  }
}

}  // namespace stickslip
