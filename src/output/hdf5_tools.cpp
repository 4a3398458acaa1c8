#include "output/hdf5_tools.hpp"

#include <fcntl.h>
#include <hdf5_hl.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <map>
#include <stdexcept>

#include "base/json.hpp"
#include "base/process.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/base/root.hpp"
#include "stickslip/base/text.hpp"
#include "stickslip/options/options.hpp"

namespace stickslip::h5 {

namespace {

constexpr hsize_t largest_chunk = 1 << 26;    // bytes: rank 0 holds one
constexpr hsize_t most_compressed = 1 << 24;  // values in a file that need not have a byte for each

// The innermost entry of the error stack says what the system said: "... error message = 'No space left on
// device'".
herr_t innermost(unsigned, const H5E_error2_t* entry, void* out) {
  auto& text = *static_cast<std::string*>(out);
  if (text.empty() && entry->desc) text = entry->desc;
  return 0;
}

std::string reason() {
  std::string text;
  H5Ewalk2(H5E_DEFAULT, H5E_WALK_UPWARD, innermost, &text);
  H5Eclear2(H5E_DEFAULT);
  const std::string mark = "error message = '";
  const std::size_t begin = text.find(mark);
  if (begin != std::string::npos) {
    const std::size_t from = begin + mark.size(), end = text.find('\'', from);
    if (end != std::string::npos) return text.substr(from, end - from);
  }
  return text.empty() ? "HDF5 gives no reason" : "HDF5: " + text;
}

std::string file_name(hid_t object) {
  char buffer[4096];
  return H5Fget_name(object, buffer, sizeof buffer) > 0 ? buffer : "?";
}

void write_scalar(hid_t object, const std::string& name, hid_t type, const void* value) {
  const Id space(H5Screate(H5S_SCALAR));
  const Id attribute(H5Acreate2(object, name.c_str(), type, space, H5P_DEFAULT, H5P_DEFAULT));
  if (!attribute || H5Awrite(attribute, type, value) < 0) fail("write attribute " + name + " of", object);
}

Id open_attribute(hid_t object, const std::string& name, H5T_class_t wanted) {
  Id attribute(H5Aopen(object, name.c_str(), H5P_DEFAULT));
  if (!attribute) fail("read attribute " + name + " of", object);
  const Id type(H5Aget_type(attribute)), space(H5Aget_space(attribute));
  const H5T_class_t found = H5Tget_class(type);
  if (found != wanted || H5Sget_simple_extent_npoints(space) != 1)
    throw Failure("attribute " + name + " of '" + file_name(object) + "' is not of the expected type");
  return attribute;
}

template <class T>
T read_number(hid_t object, const std::string& name, H5T_class_t wanted, hid_t type) {
  const Id attribute = open_attribute(object, name, wanted);
  T value = 0;
  if (H5Aread(attribute, type, &value) < 0) fail("read attribute " + name + " of", object);
  return value;
}

}  // namespace

void Id::reset() {
  if (id_ >= 0) H5Idec_ref(id_);  // NOLINT: clang-analyzer 14 loses what std::pair holds
  id_ = -1;
}

void fail(const std::string& doing, const std::string& path) {
  throw Failure("cannot " + doing + " '" + path + "': " + reason());
}

void fail(const std::string& doing, hid_t object) {
  const std::string why = reason();  // before the next call of the library clears it
  throw Failure("cannot " + doing + " '" + file_name(object) + "': " + why);
}

void quiet() {
  static const bool once = [] {
    H5open();
    H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
    H5PLset_loading_state(0);  // no code is loaded for the sake of a file's filters
    return true;
  }();
  (void)once;
}

Id create_file(const std::string& path, double bytes, hsize_t user_block, double sparse) {
  quiet();
  const hsize_t metadata = 131072;
  const double needed = bytes + 2.0 * double(metadata);
  paths::reserve(path, needed);
  // HDF5 that cannot close a file, since it may not be so long, crashes when the program ends.
  paths::check_length(path, needed + sparse);
  const Id access(H5Pcreate(H5P_FILE_ACCESS)), creation(H5Pcreate(H5P_FILE_CREATE));
  H5Pset_file_locking(access, false, true);
  if (user_block > 0) H5Pset_userblock(creation, user_block);
  // The oldest format, as by default before HDF5 2: headers of later ones have a checksum, which one that is
  // torn does not fit.
  H5Pset_libver_bounds(access, H5F_LIBVER_EARLIEST, H5F_LIBVER_LATEST);
  H5Pset_meta_block_size(access, metadata);  // one block for all of it, at the beginning
  H5Pset_sieve_buf_size(access, 0);          // raw data goes straight to the file
  H5AC_cache_config_t cache;
  cache.version = H5AC__CURR_CACHE_CONFIG_VERSION;
  H5Pget_mdc_config(access, &cache);
  cache.evictions_enabled = false;  // metadata reaches the disk in a flush only
  cache.incr_mode = H5C_incr__off;  // the library asks for these with it
  cache.flash_incr_mode = H5C_flash_incr__off;
  cache.decr_mode = H5C_decr__off;
  H5Pset_mdc_config(access, &cache);
  Id file(H5Fcreate(path.c_str(), H5F_ACC_TRUNC, creation, access));
  if (!file) fail("create", path);
  paths::reserve(path, needed);  // creation has given back what was taken
  return file;
}

Id open_file(const std::string& path) {
  quiet();
  const Id access(H5Pcreate(H5P_FILE_ACCESS));
  H5Pset_file_locking(access, false, true);
  Id file(H5Fopen(path.c_str(), H5F_ACC_RDONLY, access));
  if (!file) fail("open", path);
  return file;
}

Id text_type() {
  Id type(H5Tcopy(H5T_C_S1));
  H5Tset_size(type, H5T_VARIABLE);
  H5Tset_cset(type, H5T_CSET_UTF8);
  return type;
}

void write_attribute(hid_t object, const std::string& name, const std::string& text) {
  const Id type = text_type();
  const char* pointer = text.c_str();
  write_scalar(object, name, type, &pointer);
}

void write_attribute(hid_t object, const std::string& name, double value) {
  write_scalar(object, name, H5T_NATIVE_DOUBLE, &value);
}

void write_attribute(hid_t object, const std::string& name, std::int64_t value) {
  write_scalar(object, name, H5T_NATIVE_INT64, &value);
}

bool has_attribute(hid_t object, const std::string& name) { return H5Aexists(object, name.c_str()) > 0; }

bool exists(hid_t file, const std::string& path) {
  for (std::size_t slash = path.find('/', 1);; slash = path.find('/', slash + 1)) {
    const std::string part = path.substr(0, slash);
    H5L_info_t link;
    if (H5Lexists(file, part.c_str(), H5P_DEFAULT) <= 0) return false;
    if (H5Lget_info(file, part.c_str(), &link, H5P_DEFAULT) < 0) fail("read the links of", file);
    if (link.type != H5L_TYPE_HARD)
      throw Failure("its '" + part + "' is a link to elsewhere, which is not followed");
    if (slash == std::string::npos) return true;
  }
}

std::string read_text_attribute(hid_t object, const std::string& name) {
  const Id attribute = open_attribute(object, name, H5T_STRING);
  const Id stored(H5Aget_type(attribute));
  if (H5Tis_variable_str(stored) <= 0)
    throw Failure("attribute " + name + " of '" + file_name(object) + "' is not of the expected type");
  char* text = nullptr;
  if (H5Aread(attribute, stored, &text) < 0) fail("read attribute " + name + " of", object);
  std::string out = text ? text : "";
  H5free_memory(text);
  return out;
}

double read_real_attribute(hid_t object, const std::string& name) {
  return read_number<double>(object, name, H5T_FLOAT, H5T_NATIVE_DOUBLE);
}

std::int64_t read_integer_attribute(hid_t object, const std::string& name) {
  return read_number<std::int64_t>(object, name, H5T_INTEGER, H5T_NATIVE_INT64);
}

std::vector<hsize_t> extents(hid_t dataset) {
  const Id space(H5Dget_space(dataset));
  const int rank = H5Sget_simple_extent_ndims(space);
  std::vector<hsize_t> sizes(rank > 0 ? static_cast<std::size_t>(rank) : 0);
  if (rank > 0) H5Sget_simple_extent_dims(space, sizes.data(), nullptr);
  return sizes;
}

Id open_dataset(hid_t file, const std::string& path) {
  Id dataset(exists(file, path) ? H5Dopen2(file, path.c_str(), H5P_DEFAULT) : -1);
  if (!dataset) return dataset;
  const auto refuse = [&](const std::string& why) { throw Failure("its dataset '" + path + "' " + why); };
  const Id type(H5Dget_type(dataset)), creation(H5Dget_create_plist(dataset));
  const H5T_class_t kind = H5Tget_class(type);
  if ((kind != H5T_FLOAT && kind != H5T_INTEGER) || H5Tget_size(type) > 16) refuse("does not hold numbers");
  const H5D_layout_t layout = H5Pget_layout(creation);
  if (layout == H5D_VIRTUAL || (layout == H5D_CONTIGUOUS && H5Pget_external_count(creation) > 0))
    refuse("has its values in other files, which are not opened");
  hsize_t chunk[H5S_MAX_RANK], values = 1;
  const int rank = layout == H5D_CHUNKED ? H5Pget_chunk(creation, H5S_MAX_RANK, chunk) : 0;
  for (int d = 0; d < rank; ++d) values *= chunk[d];  // a chunk has less than 2^32 bytes
  if (values * H5Tget_size(type) > largest_chunk) refuse("is in chunks of more than 64 MB");
  return dataset;
}

hsize_t most_values(hid_t file) {
  hsize_t size = 0;
  if (H5Fget_filesize(file, &size) < 0) fail("read the size of", file);
  return std::max(size, most_compressed);
}

std::vector<double> read_reals(hid_t file, const std::string& name) {
  const Id dataset = open_dataset(file, name);
  if (!dataset) throw Failure("'" + file_name(file) + "' has no dataset '" + name + "'");
  const Id space(H5Dget_space(dataset));
  const hssize_t points = H5Sget_simple_extent_npoints(space);
  if (points < 0 || static_cast<hsize_t>(points) > most_values(file))
    throw Failure("is damaged (dataset '" + name + "' is larger than the file)");
  std::vector<double> values(points);
  if (!values.empty() &&
      H5Dread(dataset, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data()) < 0)
    fail("read '" + name + "' of", file);
  return values;
}

std::vector<double> read_rows(hid_t dataset, hsize_t first, hsize_t count, hsize_t width) {
  return read_block(dataset, first, count, 0, width);
}

std::vector<double> read_block(hid_t dataset, hsize_t row, hsize_t rows, hsize_t column, hsize_t columns) {
  std::vector<double> values(rows * columns);
  if (values.empty()) return values;
  const Id in_file(H5Dget_space(dataset));
  const hsize_t start[2] = {row, column}, size[2] = {rows, columns}, total = rows * columns;
  const Id in_memory(H5Screate_simple(1, &total, nullptr));
  if (H5Sselect_hyperslab(in_file, H5S_SELECT_SET, start, nullptr, size, nullptr) < 0 ||
      H5Dread(dataset, H5T_NATIVE_DOUBLE, in_memory, in_file, H5P_DEFAULT, values.data()) < 0)
    fail("read", dataset);
  return values;
}

std::vector<std::string> attribute_names(hid_t object) {
  std::vector<std::string> names;
  const auto visit = [](hid_t, const char* name, const H5A_info_t*, void* out) -> herr_t {
    static_cast<std::vector<std::string>*>(out)->emplace_back(name);
    return 0;
  };
  hsize_t at = 0;
  if (H5Aiterate2(object, H5_INDEX_NAME, H5_ITER_INC, &at, visit, &names) < 0)
    fail("list the attributes of", object);
  return names;
}

Id open_group(hid_t file, const std::string& group) {
  Id handle(group == "/" || exists(file, group) ? H5Gopen2(file, group.c_str(), H5P_DEFAULT) : -1);
  if (!handle) fail("open group " + group + " of", file);
  return handle;
}

std::vector<std::string> members(hid_t file, const std::string& group) {
  const Id handle = open_group(file, group);
  std::vector<std::string> names;
  const auto visit = [](hid_t, const char* name, const H5L_info_t* link, void* out) -> herr_t {
    if (link->type == H5L_TYPE_HARD) static_cast<std::vector<std::string>*>(out)->emplace_back(name);
    return 0;
  };
  hsize_t at = 0;
  if (H5Literate(handle, H5_INDEX_NAME, H5_ITER_INC, &at, visit, &names) < 0) fail("list", file);
  return names;
}

void read_from_outside(const std::string& what, const std::string& path, const std::function<void()>& check,
                       const std::function<void()>& read) {
  on_root(PETSC_COMM_WORLD, [&] {
    const std::string label = what + " '" + path + "': ";
    struct stat at {};
    if (stat(path.c_str(), &at) != 0) throw UsageError(label + std::strerror(errno));
    if (!S_ISREG(at.st_mode)) throw UsageError(label + "is not a file");
    quiet();
    try {
      check();
      if (!survives(read)) throw Failure("is damaged");
      read();
    } catch (const std::exception& e) {
      throw UsageError(label + e.what());
    }
  });
}

bool survives(const std::function<void()>& act) {
  const pid_t child = fork();
  if (child < 0) return true;  // no trial is possible
  if (child == 0) {
    for (const int number : {SIGSEGV, SIGBUS, SIGFPE, SIGABRT, SIGILL, SIGALRM, SIGTERM, SIGINT})
      signal(number, SIG_DFL);
    const rlimit no_core{0, 0};
    setrlimit(RLIMIT_CORE, &no_core);
    const int nowhere = open("/dev/null", O_WRONLY);  // for what the C library says when it gives up
    if (nowhere >= 0) dup2(nowhere, STDERR_FILENO);
    alarm(60);
    try {
      act();
    } catch (...) {
      // an orderly error, which the parent will meet and report
    }
    _exit(0);
  }
  int status = 0;
  while (waitpid(child, &status, 0) < 0)
    if (errno != EINTR) return true;
  return WIFEXITED(status) && WEXITSTATUS(status) == 0;
}

void write_header(hid_t file, const Provenance& provenance, const std::string& kind) {
  write_attribute(file, "program", std::string("stickslip"));
  write_attribute(file, "kind", kind);
  write_attribute(file, "version", std::string(version()));
  write_attribute(file, "git", std::string(git_revision()));
  write_attribute(file, "command_line", provenance.command_line);
  write_attribute(file, "options", text_of_map(provenance.options));
  write_attribute(file, "date", provenance.date);
  write_attribute(file, "ranks", static_cast<std::int64_t>(provenance.ranks));
  for (const char* name : {"model_form", "model_delta_sign"})
    if (!provenance.option(name).empty()) write_attribute(file, name, provenance.option(name));
  std::map<std::string, std::string> units;
  for (const OptionSpec& spec : option_table())
    if (const std::string unit = unit_of(spec.unit, spec.name); !unit.empty()) units[spec.name] = unit;
  if (!units.empty()) write_attribute(file, "option_units", text_of_map(units));
}

FileHeader read_header(hid_t file) {
  if (!has_attribute(file, "program") || read_text_attribute(file, "program") != "stickslip")
    throw Failure("not a file of this program");
  FileHeader header;
  header.kind = read_text_attribute(file, "kind");
  header.version = read_text_attribute(file, "version");
  header.git = read_text_attribute(file, "git");
  try {
    header.options = parse_text_map(read_text_attribute(file, "options"));
  } catch (const std::runtime_error&) {
    throw Failure("its attribute `options` is damaged");
  }
  return header;
}

void broadcast(FileHeader& header) { broadcast_all(header.kind, header.version, header.git, header.options); }

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
  const std::string own = unit_of(field.units, field.name), units = own.empty() ? field.units : own;
  if (!units.empty()) write_attribute(dataset, "units", units);
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
