#include "stickslip/output/reader.hpp"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <fmt/format.h>
#include <cerrno>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <iterator>
#include <utility>
#include <vector>

#include "base/json_values.hpp"
#include "base/process.hpp"
#include "output/hdf5_tools.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/base/root.hpp"
#include "stickslip/base/text.hpp"
#include "stickslip/output/run_file.hpp"
#include "stickslip/output/summary.hpp"

namespace stickslip {

using h5::Id;

void check_output_path(const std::string& path) {
  on_root(PETSC_COMM_WORLD, [&] {
    const paths::Present present = paths::check_writable("out_file", path);
    if (present == paths::Present::nothing) return;
    if (present == paths::Present::special)
      throw UsageError("out_file '" + path + "': is not a regular file");
    const auto look = [&] {
      const Id file = h5::open_file(path);
      (void)h5::read_header(file);
    };
    const auto refuse = [&] {
      throw UsageError("out_file '" + path +
                       "': exists and was not written by this program; give another name or remove it");
    };
    if (!h5::survives(look)) refuse();
    try {
      look();
    } catch (const Failure&) {
      refuse();
    }
  });
}

// HDF5 under the name of another format is what its reader cannot open.
static void check_ending(const std::string& path) {
  static const std::vector<std::string> others = {".csv", ".txt",  ".dat", ".json", ".yaml",
                                                  ".yml", ".xlsx", ".mat", ".png",  ".pdf"};
  const std::string name = lower_case(paths::file(path));
  for (const std::string& ending : others)
    if (name.size() > ending.size() && name.compare(name.size() - ending.size(), ending.size(), ending) == 0)
      throw UsageError("out_file '" + path + "': HDF5 is written (" +
                       path.substr(0, path.size() - ending.size()) +
                       ".h5); docs/python.md and postprocess/events.py --csv make tables of it");
}

OutputLock check_outputs(const std::string& out_file, const std::string& summary) {
  OutputLock lock;
  if (!out_file.empty()) {
    check_ending(out_file);
    check_output_path(out_file);
  }
  if (!summary.empty()) check_summary_path(summary);
  if (out_file.empty()) return lock;
  on_root(PETSC_COMM_WORLD, [&] {
    const auto place = [](const std::string& path) {
      return paths::resolved(paths::folder(path)) + "/" + paths::file(path);
    };
    if (!summary.empty() && place(paths::resolved(out_file)) == place(paths::resolved(summary)))
      throw UsageError("summary '" + summary + "': is the same file as out_file");
    lock = OutputLock(out_file);
  });
  return lock;
}

namespace {

// Opens a file of this program on rank 0 and hands it with its header to body().
template <class Body>
void reading(const std::string& what, const std::string& path, Body&& body) {
  h5::read_from_outside(
      what, path,
      [&] {
        if (H5Fis_hdf5(path.c_str()) <= 0) throw Failure("is not an HDF5 file");
      },
      [&] {
        const Id file = h5::open_file(path);
        body(static_cast<hid_t>(file));
      });
}

// The same where the file may not be one of this program, with an empty kind then.
FileHeader header_of(hid_t file) {
  return h5::has_attribute(file, "program") ? h5::read_header(file) : FileHeader();
}

// How much of a file may be held, all its fields together.
class Room {
 public:
  explicit Room(hid_t file) : left_(h5::most_values(file)) {}
  void take(hsize_t values) {
    if (values > left_) throw Failure("is damaged (its fields are larger than the file)");
    left_ -= values;
  }

 private:
  hsize_t left_;
};

// A dataset of numbers; nothing for what else a file may hold, unless it stands under the name of a field.
Id number_dataset(hid_t file, const std::string& name) {
  try {
    return h5::open_dataset(file, name);
  } catch (const Failure&) {
    if (name == "psi" || name == "eta") throw;
    return Id();
  }
}

// The variables of x in a file of others: one frame of those that have several.
void read_variables(hid_t file, std::int64_t index, Frame& frame) {
  frame.x = h5::read_reals(file, "x");
  frame.count = 1;
  const auto width = static_cast<hsize_t>(frame.x.size());
  Room room(file);
  for (const std::string& name : h5::members(file, "/")) {
    const Id object = number_dataset(file, name);
    if (name == "x" || !object) continue;
    const auto sizes = h5::extents(object);
    if (sizes.empty() || sizes.size() > 2 || sizes.back() != width) continue;
    room.take(width);
    const auto frames = sizes.size() == 2 ? static_cast<std::int64_t>(sizes[0]) : 1;
    const std::int64_t wanted = index == -1 ? frames - 1 : index;
    if (wanted < 0 || wanted >= frames)
      throw Failure(fmt::format("its {} has {} frames, not frame {}", name, frames, index));
    frame.fields[name] = sizes.size() == 2 ? h5::read_rows(object, static_cast<hsize_t>(wanted), 1, width)
                                           : h5::read_reals(file, name);
    frame.count = std::max(frame.count, frames);
    frame.index = std::max(frame.index, wanted);
  }
}

}  // namespace

FileHeader read_header(const std::string& what, const std::string& path) {
  FileHeader header;
  reading(what, path, [&](hid_t file) { header = h5::read_header(file); });
  h5::broadcast(header);
  return header;
}

std::string kind_of(const std::string& what, const std::string& path) {
  std::string kind;
  reading(what, path, [&](hid_t file) { kind = header_of(file).kind; });
  broadcast(kind);
  return kind;
}

DataArray read_array(const std::string& what, const std::string& path, const std::string& name) {
  DataArray array;
  reading(what, path, [&](hid_t file) {
    (void)h5::read_header(file);
    array.values = h5::read_reals(file, name);
    const Id dataset = h5::open_dataset(file, name);
    for (const hsize_t size : h5::extents(dataset)) array.shape.push_back(size);
  });
  broadcast_all(array.shape, array.values);
  return array;
}

Frame read_frame(const std::string& what, const std::string& path, std::int64_t index) {
  Frame frame;
  reading(what, path, [&](hid_t file) {
    const FileHeader header = header_of(file);
    const auto check_fields = [&] {
      for (const char* name : {"psi", "eta"})
        if (!frame.fields.count(name)) {
          (void)h5::exists(file, name);  // throws where it is a link
          throw Failure(std::string("has no dataset '") + name + "' of (t, x)");
        }
    };
    if (header.kind.empty()) {
      read_variables(file, index, frame);
      return check_fields();
    }
    if (header.kind != "run") throw Failure("holds the result of `" + header.kind + "`, not of `run`");
    const std::vector<double> t = h5::read_reals(file, "t");
    frame.x = h5::read_reals(file, "x");
    frame.count = static_cast<std::int64_t>(t.size());
    frame.index = index == -1 ? frame.count - 1 : index;
    if (frame.index < 0 || frame.index >= frame.count)
      throw Failure(
          fmt::format("has {} frames (0 to {}), not frame {}", frame.count, frame.count - 1, index));
    frame.t = t[frame.index];
    frame.options = header.options;
    Room room(file);
    for (const std::string& name : h5::members(file, "/")) {
      const Id object = number_dataset(file, name);
      if (!object) continue;
      const auto sizes = h5::extents(object);
      if (sizes.size() != 2 || sizes[1] != frame.x.size() || sizes[0] <= static_cast<hsize_t>(frame.index))
        continue;
      room.take(sizes[1]);
      frame.fields[name] = h5::read_rows(object, static_cast<hsize_t>(frame.index), 1, sizes[1]);
    }
    check_fields();
  });
  broadcast_all(frame.t, frame.index, frame.count, frame.x, frame.fields, frame.options);
  return frame;
}

namespace {

// Whether the open file still has that name: its last holder may have removed it in the meantime.
bool is_named(int descriptor, const std::string& name) {
  struct stat open_one {
  }, named{};
  return fstat(descriptor, &open_one) == 0 && stat(name.c_str(), &named) == 0 &&
         open_one.st_ino == named.st_ino && open_one.st_dev == named.st_dev;
}

// For the one who is held off.
void sign(int descriptor) {
  char host[256] = "?", text[300];
  (void)gethostname(host, sizeof host - 1);
  const int size = std::snprintf(text, sizeof text, "process %ld on %s", long(getpid()), host);
  if (ftruncate(descriptor, 0) == 0) (void)!pwrite(descriptor, text, std::size_t(size), 0);
}

std::string signature(int descriptor) {
  char text[300] = "";
  const ssize_t size = pread(descriptor, text, sizeof text - 1, 0);
  return size > 0 ? " (" + std::string(text, std::size_t(size)) + ")" : "";
}

}  // namespace

OutputLock::OutputLock(const std::string& path)
    : name_(paths::hidden_sibling(paths::resolved(path), ".lock")) {
  for (;;) {
    const int file = open(name_.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0666);
    if (file < 0)
      throw UsageError("out_file '" + path + "': cannot make '" + name_ + "' (" + std::strerror(errno) + ")");
    if (flock(file, LOCK_EX | LOCK_NB) != 0) {
      const bool taken = errno == EWOULDBLOCK;
      const std::string by = taken ? signature(file) : "";
      close(file);
      if (!taken) return;  // no locks on this file system; what was made goes with this object
      throw UsageError("out_file '" + path + "': another command writes it now" + by +
                       "; wait for its end or give another name");
    }
    if (is_named(file, name_)) {
      descriptor_ = file;
      sign(file);
      return;
    }
    close(file);
  }
}

OutputLock::~OutputLock() {
  if (!name_.empty()) unlink(name_.c_str());  // before the lock is given back
  if (descriptor_ >= 0) close(descriptor_);
}

namespace {
CarriedFrame* newest = nullptr;
}  // namespace

CarriedFrame::CarriedFrame(std::optional<Frame> from)
    : start(std::move(from)), before_(std::exchange(newest, this)) {}
CarriedFrame::~CarriedFrame() { newest = before_; }
CarriedFrame* CarriedFrame::innermost() { return newest; }

void CarriedFrame::keep(const Model& model, const Scene& whole, Vec u, double t) {
  const StateLaw law = whole.friction.state;
  std::vector<std::string> names{"psi", "eta"};
  if (model.dof() == 3) names.push_back(state_name(law));
  Frame frame;
  frame.t = t;
  frame.count = 1;
  frame.options["model_form"] = to_string(whole.form);
  for (PetscInt i = 0; i < whole.n; ++i) frame.x.push_back(whole.x(i));
  Gather gather(u, model.dof());
  const std::vector<std::vector<double>>& own = gather.components(u);
  for (std::size_t d = 0; d < names.size(); ++d) {
    std::vector<double> values;
    for (PetscInt i = 0; i < whole.n && !own[d].empty(); ++i) {
      const double value = own[d][i % model.scene().n] - (d == 1 ? whole.push(t) : 0);
      values.push_back(d == 2 ? state_to_output(law, value) : value);
    }
    broadcast(values);
    frame.fields[names[d]] = std::move(values);
  }
  end = std::move(frame);
}

void save_frame(const std::string& path, const Frame& frame) {
  on_root(PETSC_COMM_WORLD, [&] {
    Json fields = Json::object();
    for (const auto& [name, values] : frame.fields) fields[name] = values;
    const std::vector<std::uint8_t> bytes = Json::to_cbor(Json::object(
        {{"t", frame.t}, {"form", frame.options.at("model_form")}, {"x", frame.x}, {"fields", fields}}));
    paths::replace_file(path, std::string(bytes.begin(), bytes.end()), ".tmp", false);
  });
}

Frame load_frame(const std::string& path) {
  Frame frame;
  std::string form;
  on_root(PETSC_COMM_WORLD, [&] {
    std::ifstream file(path, std::ios::binary);
    const std::vector<char> bytes((std::istreambuf_iterator<char>(file)), std::istreambuf_iterator<char>());
    try {
      const Json all = Json::from_cbor(bytes);
      frame.t = all.at("t").get<double>();
      form = all.at("form").get<std::string>();
      frame.x = all.at("x").get<std::vector<double>>();
      for (const auto& [name, values] : all.at("fields").items())
        frame.fields[name] = values.get<std::vector<double>>();
    } catch (const std::exception&) {
      throw Failure("cannot read '" + path + "', in which a line that is followed stands");
    }
  });
  broadcast_all(frame.t, form, frame.x, frame.fields);
  frame.count = 1;
  frame.options["model_form"] = form;
  return frame;
}

}  // namespace stickslip
