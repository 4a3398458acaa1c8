#include "output/datasets.hpp"

#include <hdf5_hl.h>

namespace stickslip::h5 {

Id create_dataset(hid_t file, const std::string& name, hid_t type, hid_t space, hid_t creation,
                  hid_t access) {
  const Id links(H5Pcreate(H5P_LINK_CREATE));
  H5Pset_create_intermediate_group(links, 1);
  Id dataset(H5Dcreate2(file, name.c_str(), type, space, links, creation, access));
  if (!dataset) fail("make dataset " + name + " in", "the file");
  return dataset;
}

Id dataset_creation() {
  Id properties(H5Pcreate(H5P_DATASET_CREATE));
  H5Pset_obj_track_times(properties, false);
  return properties;
}

void describe(hid_t dataset, const Field& field) {
  if (!field.units.empty()) write_attribute(dataset, "units", field.units);
  if (!field.long_name.empty()) write_attribute(dataset, "long_name", field.long_name);
}

Id write_fixed(hid_t file, const Field& field, const std::vector<hsize_t>& dims,
               const std::vector<double>& values) {
  const Id space(dims.empty() ? H5Screate(H5S_SCALAR)
                              : H5Screate_simple(static_cast<int>(dims.size()), dims.data(), nullptr));
  Id dataset = create_dataset(file, field.name, H5T_NATIVE_DOUBLE, space, dataset_creation(), H5P_DEFAULT);
  if (!values.empty() &&
      H5Dwrite(dataset, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data()) < 0)
    fail("write", field.name);
  describe(dataset, field);
  return dataset;
}

Id write_line(hid_t file, const Field& field, hsize_t size, const std::function<double(std::int64_t)>& at) {
  const Id space(H5Screate_simple(1, &size, nullptr));
  Id dataset = create_dataset(file, field.name, H5T_NATIVE_DOUBLE, space, dataset_creation(), H5P_DEFAULT);
  std::vector<double> piece;
  for (hsize_t first = 0; first < size; first += largest_piece) {
    const hsize_t count = std::min(largest_piece, size - first);
    piece.resize(count);
    for (hsize_t k = 0; k < count; ++k) piece[k] = at(static_cast<std::int64_t>(first + k));
    const Id in_memory(H5Screate_simple(1, &count, nullptr));
    if (H5Sselect_hyperslab(space, H5S_SELECT_SET, &first, nullptr, &count, nullptr) < 0 ||
        H5Dwrite(dataset, H5T_NATIVE_DOUBLE, in_memory, space, H5P_DEFAULT, piece.data()) < 0)
      fail("write", field.name);
  }
  describe(dataset, field);
  return dataset;
}

void make_scale(hid_t dataset, const std::string& name) {
  if (H5DSset_scale(dataset, name.c_str()) < 0) fail("make a dimension scale of", name);
}

void attach_scale(hid_t dataset, hid_t scale, unsigned dimension) {
  if (H5DSattach_scale(dataset, scale, dimension) < 0) fail("attach a dimension scale to", "a dataset");
}

}  // namespace stickslip::h5
