// Datasets with units and dimension scales, as every file of this program has them. Rank 0 only.
#pragma once

#include <string>
#include <vector>

#include "base/paths.hpp"
#include "output/hdf5_tools.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/output/field.hpp"

namespace stickslip::h5 {

// A new dataset, its groups made where they are missing; an old one of the name is a mistake in the program.
// All of these throw Failure.
Id create_dataset(hid_t file, const std::string& name, hid_t type, hid_t space, hid_t creation, hid_t access);
// No times in the headers: with them every write would change more than the extents.
Id dataset_creation();
// Attributes units and long_name, where there are any.
void describe(hid_t dataset, const Field& field);
// Doubles, row-major, written at once; no dims: a scalar.
Id write_fixed(hid_t file, const Field& field, const std::vector<hsize_t>& dims,
               const std::vector<double>& values);
// Doubles along x, made piece by piece: a long list is never held.
Id write_line(hid_t file, const Field& field, hsize_t size, const std::function<double(std::int64_t)>& at);
void make_scale(hid_t dataset, const std::string& name);
void attach_scale(hid_t dataset, hid_t scale, unsigned dimension);

// Errors name the file that the user knows: no temporary one, and not none.
template <class Body>
void naming(const std::string& path, Body&& body) {
  try {
    body();
  } catch (const Failure& e) {
    std::string text = e.what();
    for (const char* suffix : {".tmp", ".new"}) {
      const std::string hidden = paths::hidden_sibling(path, suffix);
      const std::size_t at = text.find(hidden);
      if (at != std::string::npos) text.replace(at, hidden.size(), path);
    }
    if (text.find("'" + path + "'") == std::string::npos) text = "cannot write '" + path + "': " + text;
    throw Failure(text);
  }
}

}  // namespace stickslip::h5
