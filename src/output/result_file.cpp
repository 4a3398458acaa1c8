#include "stickslip/output/result_file.hpp"

#include <unistd.h>

#include <map>
#include <stdexcept>
#include <utility>

#include "base/paths.hpp"
#include "output/hdf5_tools.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/base/root.hpp"

namespace stickslip {

using h5::Id;

struct ResultFile::Contents {
  struct Entry {
    Field field;  // its name with the group
    std::vector<std::string> dimensions;
    std::vector<double> values;
    std::vector<std::string> texts;
    bool is_text = false, is_scale = false;
  };
  std::vector<Entry> entries;
  std::vector<std::pair<std::string, std::string>> texts;
  std::vector<std::pair<std::string, double>> numbers;

  double bytes() const;  // of the data, an upper bound
  void write(hid_t file) const;
};

namespace {

Id write_texts(hid_t file, const Field& field, const std::vector<hsize_t>& dims,
               const std::vector<std::string>& texts) {
  const Id type = h5::text_type();
  const Id space(H5Screate_simple(static_cast<int>(dims.size()), dims.data(), nullptr));
  Id dataset = h5::create_dataset(file, field.name, type, space, h5::dataset_creation(), H5P_DEFAULT);
  std::vector<const char*> pointers;
  for (const std::string& text : texts) pointers.push_back(text.c_str());
  if (!pointers.empty() && H5Dwrite(dataset, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, pointers.data()) < 0)
    h5::fail("write", field.name);
  h5::describe(dataset, field);
  return dataset;
}

}  // namespace

ResultFile::ResultFile(MPI_Comm comm, std::string path, Provenance provenance)
    : comm_(comm), path_(std::move(path)), provenance_(std::move(provenance)),
      contents_(std::make_unique<Contents>()) {}

ResultFile::~ResultFile() = default;

void ResultFile::attribute(const std::string& name, const std::string& text) {
  contents_->texts.emplace_back(name, text);
}

void ResultFile::attribute(const std::string& name, double value) {
  contents_->numbers.emplace_back(name, value);
}

void ResultFile::scale(const Field& field, std::vector<double> values) {
  contents_->entries.push_back({field, {}, std::move(values), {}, false, true});
}

void ResultFile::scale_text(const Field& field, std::vector<std::string> values) {
  contents_->entries.push_back({field, {}, {}, std::move(values), true, true});
}

void ResultFile::add(const Field& field, const std::vector<std::string>& dimensions,
                     std::vector<double> values) {
  contents_->entries.push_back({field, dimensions, std::move(values), {}, false, false});
}

void ResultFile::add_text(const Field& field, const std::vector<std::string>& dimensions,
                          std::vector<std::string> values) {
  contents_->entries.push_back({field, dimensions, {}, std::move(values), true, false});
}

void ResultFile::add_complex(const Field& field, const std::vector<std::string>& dimensions,
                             const std::vector<std::complex<double>>& values) {
  std::vector<double> re, im;
  for (const auto& z : values) {
    re.push_back(z.real());
    im.push_back(z.imag());
  }
  add({field.name + "_re", field.units, field.long_name + ", real part"}, dimensions, re);
  add({field.name + "_im", field.units, field.long_name + ", imaginary part"}, dimensions, im);
}

double ResultFile::Contents::bytes() const {
  double sum = 0;
  for (const Entry& entry : entries) {
    sum += 2 * 8.0 * double(entry.values.size());  // twice: for a scale that is made where there is none
    for (const std::string& text : entry.texts) sum += 64 + double(text.size());
  }
  return sum;
}

void ResultFile::Contents::write(hid_t file) const {
  for (const auto& [name, text] : texts) h5::write_attribute(file, name, text);
  for (const auto& [name, value] : numbers) h5::write_attribute(file, name, value);
  std::map<std::string, Id> scales;
  const auto leaf = [](const std::string& name) { return name.substr(name.rfind('/') + 1); };
  const auto keep = [&](const Field& field, Id dataset) {
    h5::make_scale(dataset, leaf(field.name));
    scales.emplace(field.name, std::move(dataset));
  };
  const auto make = [&](const Field& field, const std::vector<double>& values) {
    keep(field, h5::write_fixed(file, field, {values.size()}, values));
  };
  for (const Entry& entry : entries) {
    if (!entry.is_scale) continue;
    if (entry.is_text)
      keep(entry.field, write_texts(file, entry.field, {entry.texts.size()}, entry.texts));
    else
      make(entry.field, entry.values);
  }

  for (const Entry& entry : entries) {
    if (entry.is_scale) continue;
    const std::string& name = entry.field.name;
    const std::size_t count = entry.is_text ? entry.texts.size() : entry.values.size();
    const std::size_t slash = name.rfind('/');
    const std::string group = slash == std::string::npos ? "" : name.substr(0, slash + 1);
    // in the group of the dataset, which the name may have or not
    const auto beside = [&](const std::string& dimension) {
      return dimension.rfind(group, 0) == 0 ? dimension : group + dimension;
    };
    std::vector<std::string> used;
    std::vector<hsize_t> dims;
    hsize_t known = 1;
    for (const std::string& dimension : entry.dimensions) {
      const std::string here = beside(dimension);
      used.push_back(scales.count(here) ? here : scales.count(dimension) ? dimension : "");
      dims.push_back(used.back().empty() ? 0 : h5::extents(scales.at(used.back()))[0]);
      if (!used.back().empty()) known *= dims.back();
    }
    // the size of one dimension without a scale follows from the number of values
    for (std::size_t d = 0; d < dims.size(); ++d)
      if (used[d].empty()) {
        dims[d] = known > 0 ? count / known : 0;
        known *= dims[d];
        std::vector<double> counting(dims[d]);
        for (std::size_t k = 0; k < counting.size(); ++k) counting[k] = double(k);
        used[d] = beside(entry.dimensions[d]);
        make({used[d], "1", "index"}, counting);
      }
    if (known != count) throw std::logic_error("dataset '" + name + "' does not fit its dimensions");

    const Id dataset = entry.is_text ? write_texts(file, entry.field, dims, entry.texts)
                                     : h5::write_fixed(file, entry.field, dims, entry.values);
    for (std::size_t d = 0; d < used.size(); ++d)
      h5::attach_scale(dataset, scales.at(used[d]), static_cast<unsigned>(d));
  }
}

void ResultFile::write() {
  if (path_.empty()) return;
  on_root(comm_, [&] {
    const std::string path = paths::resolved(path_);
    const auto write = [&](const std::string& name) {
      Id file = h5::create_file(name, contents_->bytes());
      h5::write_header(file, provenance_, provenance_.command);
      contents_->write(file);
      if (H5Fflush(file, H5F_SCOPE_GLOBAL) < 0 || H5Fclose(file.release()) < 0) h5::fail("write", path);
    };
    h5::naming(path, [&] { paths::replace_file(path, write); });
  });
}

}  // namespace stickslip
