// Summaries, HDF5 files, checkpoints. The central test records every write that the HDF5 library makes into
// the file of a run and opens the file as a kill would have left it after each of them.
#include <hdf5.h>
#include <petscvec.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <functional>
#include <iterator>
#include <limits>
#include <sstream>

#include "base/json_values.hpp"
#include "catch.hpp"
#include "stickslip/base/root.hpp"
#include "stickslip/base/vectors.hpp"
#include "stickslip/output/checkpoint.hpp"
#include "stickslip/output/reader.hpp"
#include "stickslip/output/result_file.hpp"
#include "stickslip/output/run_file.hpp"
#include "stickslip/output/summary.hpp"
#include "stickslip/study/size.hpp"

using namespace stickslip;

namespace {

struct Write {
  ino_t file;
  off_t offset;
  std::string bytes;
};
bool recording = false;
std::vector<Write> record;
int writes_left = -1;        // until the disk is full; negative: it never is
const off_t taken = 262144;  // what a file has taken of the disk when it was made, writes there still succeed

}  // namespace

// Takes the place of the C library's function, for HDF5 too.
extern "C" ssize_t pwrite(int fd, const void* data, size_t size, off_t offset) {
  if (writes_left >= 0 && offset >= taken && writes_left-- == 0) {
    writes_left = 0;
    errno = ENOSPC;
    return -1;
  }
  if (recording) {
    struct stat at {};
    fstat(fd, &at);
    record.push_back({at.st_ino, offset, std::string(static_cast<const char*>(data), size)});
  }
  return syscall(SYS_pwrite64, fd, data, size, offset);
}

namespace {

int my_rank() {
  int rank = 0;
  MPI_Comm_rank(PETSC_COMM_WORLD, &rank);
  return rank;
}

// A folder of its own for a test, the same on every rank, removed at its end.
class Folder {
 public:
  Folder() {
    char name[] = "/tmp/stickslip-test-XXXXXX";
    if (my_rank() == 0 && !mkdtemp(name)) std::abort();
    MPI_Bcast(name, sizeof name, MPI_CHAR, 0, PETSC_COMM_WORLD);
    path_ = name;
  }
  ~Folder() {
    MPI_Barrier(PETSC_COMM_WORLD);
    if (my_rank() == 0 && std::system(("rm -rf " + path_).c_str()) != 0) std::abort();
  }
  std::string operator/(const std::string& name) const { return path_ + "/" + name; }

 private:
  std::string path_;
};

std::string content(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

void put(const std::string& path, const std::string& bytes) {
  if (my_rank() == 0) std::ofstream(path, std::ios::binary) << bytes;
  MPI_Barrier(PETSC_COMM_WORLD);
}

// On every rank at the same moment: between two barriers.
bool present(const std::string& path) {
  MPI_Barrier(PETSC_COMM_WORLD);
  const bool found = access(path.c_str(), F_OK) == 0;
  MPI_Barrier(PETSC_COMM_WORLD);
  return found;
}

Provenance some_provenance(const std::string& command = "run") {
  return Provenance::of(command, {{"model_form", "continuum"},
                                  {"model_gamma", "3"},
                                  {"model_delta_sign", "derived"},
                                  {"out_file", "a \"quoted\" \\ name\nwith a line"}});
}

double psi_value(int frame, std::size_t node) { return std::sin(1.0 + frame) + 1e-3 * double(node); }
double eta_value(int frame, std::size_t node) { return -std::cos(1.0 + frame) + 1e-3 * double(node); }

RunLayout some_layout(std::size_t n, std::int64_t frames) {
  RunLayout layout;
  layout.slab = Slab::even(PETSC_COMM_WORLD, std::int64_t(n));
  layout.x = [](std::int64_t node) { return 0.1 * double(node); };
  layout.fields = {standard_field("psi"), standard_field("eta")};
  layout.groups = {
      {"probes", standard_field("t"), {standard_field("psi"), standard_field("eta")}, {0.25, 0.5}},
      {"series", standard_field("t"), {{"psi_mean", "length/time", "mean"}, {"dt", "time", "step"}}}};
  layout.frames = frames;
  return layout;
}

void write_frame(RunFile& file, int k, std::size_t n) {
  const Slab slab = Slab::even(PETSC_COMM_WORLD, std::int64_t(n));
  std::vector<double> psi, eta;
  for (std::size_t i = 0; i < slab.kept(); ++i) {
    psi.push_back(psi_value(k, std::size_t(slab.first()) + i));
    eta.push_back(eta_value(k, std::size_t(slab.first()) + i));
  }
  file.row("probes", k, {1.0 * k, 2.0 * k, -1.0 * k, -2.0 * k});
  file.row("series", k, {psi_value(k, 0), 0.5});
  file.frame(k, {psi.data(), eta.data()});
}

bool frame_is_right(const std::string& path, int k, std::size_t n) {
  const Frame frame = read_frame("init_file", path, k);
  bool right = frame.t == k && frame.x.size() == n;
  for (std::size_t i = 0; right && i < n; ++i)
    right = frame.fields.at("psi")[i] == psi_value(k, i) && frame.fields.at("eta")[i] == eta_value(k, i);
  return right;
}

std::string usage_error(const std::function<void()>& act) {
  try {
    act();
  } catch (const UsageError& e) {
    return e.what();
  }
  return "no error";
}

}  // namespace

TEST_CASE("JSON: reals come back, order stays, text is escaped", "[output]") {
  for (const double value :
       {0.1, 1.0 / 3, -0.0, 5e-324, 1.7976931348623157e308, 60.0, 1e23, 123456789012345680.0}) {
    const std::string text = json_text(Json(value));
    const double back = std::strtod(text.c_str(), nullptr);
    CHECK(back == value);
    CHECK(std::signbit(back) == std::signbit(value));
    CHECK(text.find_first_of(".e") != std::string::npos);
  }
  CHECK(json_text(Json(std::nan(""))) == "null");
  CHECK(json_text(Json(-HUGE_VAL)) == "null");
  CHECK(json_text(Json(std::optional<double>())) == "null");
  CHECK(json_text(Json(true)) == "true");
  CHECK(json_text(Json(PetscInt(7))) == "7");
  CHECK(json_text(Json("a\"\\\n\x01\xC3\xA9\xFF")) == "\"a\\\"\\\\\\n\\u0001\xC3\xA9\xEF\xBF\xBD\"");
  const Json object = Json::object({{"z", 1}, {"a", Json::object({{"list", std::vector<double>{1, 2.5}}})}});
  CHECK(json_text(object, 0) == R"({"z":1,"a":{"list":[1.0,2.5]}})");
  CHECK(json_text(Json::array()) == "[]");
  CHECK(json_text(Json::object()) == "{}");

  const std::map<std::string, std::string> texts{
      {"", ""}, {"q\"", "\\ \x02 \t\n/"}, {"\xC3\xA9", "\xE2\x82\xAC"}};
  CHECK(parse_text_map(json_text(Json(texts))) == texts);
  CHECK(parse_text_map(json_text(Json(texts), 0)) == texts);
  for (const char* bad : {"", "{", "{}x", "[]", "{\"a\":1}", "{\"a\":\"b\",}", "{\"a\":\"\\"})
    CHECK_THROWS_AS(parse_text_map(bad), std::runtime_error);
}

TEST_CASE("summary: all keys whatever happens, written whole", "[output]") {
  const Folder folder;
  const std::string path = folder / "s.json";
  Summary summary(some_provenance(), {{"t_end"}, {"steps"}}, path);
  const std::vector<std::string> keys{"command",    "status",     "reason", "warnings", "version", "git",
                                      "model_form", "delta_sign", "ranks",  "wall_s",   "t_end",   "steps",
                                      "options"};
  CHECK_THROWS_AS(summary.set("speed", 1), std::logic_error);

  CHECK_THROWS_AS(with_summary(summary, []() -> int { throw UsageError("wrong"); }), UsageError);
  CHECK(!present(path));
  CHECK_THROWS_AS(with_summary(summary,
                               [&]() -> int {
                                 summary.set("t_end", 1.5);
                                 throw Failure("the disk is full");
                               }),
                  Failure);
  MPI_Barrier(PETSC_COMM_WORLD);
  std::string text = content(path);
  CHECK(text.find("\"status\": \"failed\"") != std::string::npos);
  CHECK(text.find("\"reason\": \"the disk is full\"") != std::string::npos);
  CHECK(text.find("\"t_end\": 1.5") != std::string::npos);
  CHECK(text.find("\"steps\": null") != std::string::npos);
  std::size_t at = 0;
  for (const std::string& key : keys) {
    const std::size_t found = text.find("\n  \"" + key + "\": ");
    CHECK(found != std::string::npos);
    CHECK(found >= at);  // in this order
    at = found;
  }
  MPI_Barrier(PETSC_COMM_WORLD);

  Summary good(some_provenance(), {{"steps"}}, path);  // replaces the old one
  CHECK(with_summary(good, [&] {
          good.set("steps", 12);
          return 0;
        }) == 0);
  MPI_Barrier(PETSC_COMM_WORLD);
  text = content(path);
  CHECK(text.find("\"status\": \"done\"") != std::string::npos);
  CHECK(text.find("\"reason\": null") != std::string::npos);
  CHECK(text.find("\"steps\": 12,\n") != std::string::npos);
  MPI_Barrier(PETSC_COMM_WORLD);

  Summary stopped(some_provenance(), {}, path);
  CHECK(with_summary(stopped, [&] {
          stopped.stopped("SIGTERM");
          return 143;
        }) == 143);
  MPI_Barrier(PETSC_COMM_WORLD);
  CHECK(content(path).find("\"status\": \"stopped\"") != std::string::npos);
}

TEST_CASE("outputs that cannot be written are found before any work", "[output]") {
  const Folder folder;
  put(folder / "text", "model: {gamma: 3}\n");
  put(folder / "old.json", " {\"command\": \"run\"}\n");
  put(folder / "empty", "");
  put(folder / "foreign.h5", "\x89HDF\r\n\x1a\n and nothing else");
  const auto of = [](const std::string& text) { return Contains(text); };
  const auto summary = [&](const std::string& path) {
    return usage_error([&] { check_summary_path(path); });
  };
  const auto out = [&](const std::string& path) { return usage_error([&] { check_output_path(path); }); };

  for (const char* good : {"new.json", "old.json", "empty"}) CHECK(summary(folder / good) == "no error");
  CHECK(summary("-") == "no error");
  CHECK(summary("/dev/null") == "no error");
  CHECK_THAT(summary(folder / "text"), of("not a JSON summary"));
  CHECK_THAT(summary(folder / ""), of("is a folder"));
  CHECK_THAT(summary(folder / "none/s.json"), of("/none' does not exist"));
  CHECK_THAT(summary(""), of("name of a file"));
  CHECK_THAT(summary(folder / std::string(300, 'x')), of("File name too long"));

  CHECK(out(folder / "new.h5") == "no error");
  CHECK(!present(folder / "new.h5"));
  for (const char* name : {"text", "empty", "foreign.h5", "old.json"})
    CHECK_THAT(out(folder / name), of("was not written by this program"));
  CHECK_THAT(out(folder / ""), of("is a folder"));
  CHECK_THAT(out(folder / "none/a.h5"), of("out_file '" + (folder / "none/a.h5") + "': the folder"));
  CHECK_THAT(out("/dev/null"), of("not a regular file"));
  if (present("/proc/self/stat"))  // where it is mounted: a folder that refuses, root too
    CHECK_THAT(out("/proc/a.h5"), of("cannot be written"));
  CHECK_THAT(usage_error([&] { (void)check_outputs(folder / "a", folder / "a"); }),
             of("the same file as out_file"));
  CHECK_THAT(usage_error([&] { (void)check_outputs(folder / "a", (folder / "") + "./a"); }),
             of("the same file"));
  CHECK(usage_error([&] { (void)check_outputs(folder / "a", folder / "b"); }) == "no error");
}

TEST_CASE("run file: frames come back, on every rank, more than were expected too", "[output]") {
  const Folder folder;
  const std::string path = folder / "r.h5";
  const std::size_t n = 7;
  put(folder / "keep", "");
  {
    RunFile file(PETSC_COMM_WORLD, path, some_provenance(), some_layout(n, 3));
    CHECK(!present(path));
    for (int k = 0; k < 10; ++k) write_frame(file, k, n);
    CHECK(file.frames() == 10);
    CHECK(file.last_time() == 9);
    CHECK_THROWS(file.frame(9, {nullptr, nullptr}));
    for (int k = 10; k < 5010; ++k) {
      file.row("probes", k, {1.0 * k, 2.0 * k, -1.0 * k, -2.0 * k});
      file.row("series", k, {1, 2});
    }
    file.flush();  // outgrows the table
    for (int k = 5010; k < 5020; ++k) file.row("series", k, {1, 2});
    file.close();
  }
  for (const int k : {0, 3, 9}) CHECK(frame_is_right(path, k, n));
  const Frame last = read_frame("init_file", path);
  CHECK(last.index == 9);
  CHECK(last.count == 10);
  CHECK(last.options == some_provenance().options);
  CHECK_THAT(usage_error([&] { read_frame("init_file", path, 10); }), Contains("10 frames"));
  const DataArray probes = read_array("x", path, "probes/psi");
  CHECK(probes.shape == std::vector<std::size_t>{5010, 2});
  bool right = true;
  for (std::size_t k = 0; k < 5010; ++k)
    right = right && probes.values[2 * k] == double(k) && probes.values[2 * k + 1] == 2.0 * double(k);
  CHECK(right);
  CHECK(read_array("x", path, "series/dt").shape == std::vector<std::size_t>{5020});
  CHECK(read_header("x", path).kind == "run");
  CHECK(usage_error([&] { check_output_path(path); }) == "no error");
  for (const char* hidden : {".r.h5.tmp", ".r.h5.new"}) CHECK(!present(folder / hidden));
}

TEST_CASE("run file: an old file stands until the first frame, a run that fails keeps its frames",
          "[output]") {
  const Folder folder;
  const std::string path = folder / "r.h5";
  {
    RunFile file(PETSC_COMM_WORLD, path, some_provenance(), some_layout(4, 2));
    write_frame(file, 5, 4);
    file.close();
  }
  const auto of_old = [&] { return read_frame("x", path).t == 5; };
  CHECK(of_old());
  {
    const RunFile file(PETSC_COMM_WORLD, path, some_provenance(), some_layout(4, 2));
    CHECK(of_old());
  }
  CHECK(of_old());  // no frame was ever written
  {
    RunFile file(PETSC_COMM_WORLD, path, some_provenance(), some_layout(4, 1000));
    write_frame(file, 0, 4);
    write_frame(file, 1, 4);
  }  // as when an exception passes
  // of frames in memory one rank cannot write what the others have
  int ranks = 1;
  MPI_Comm_size(PETSC_COMM_WORLD, &ranks);
  CHECK(read_frame("x", path).count == (ranks == 1 ? 2 : 1));
  CHECK(read_frame("x", path).t == (ranks == 1 ? 1 : 0));
  CHECK(!present(folder / ".r.h5.tmp"));
}

TEST_CASE("run file: removed or replaced under way is told", "[output]") {
  const Folder folder;
  const std::string path = folder / "r.h5";
  RunFile file(PETSC_COMM_WORLD, path, some_provenance(), some_layout(4, 20));
  write_frame(file, 0, 4);
  MPI_Barrier(PETSC_COMM_WORLD);
  if (my_rank() == 0) unlink(path.c_str());
  CHECK_THROWS_AS(file.flush(), Failure);
  put(path, "another file");
  file.close();  // has been told once
  MPI_Barrier(PETSC_COMM_WORLD);
  CHECK(content(path) == "another file");

  const std::string path2 = folder / "r2.h5";
  RunFile file2(PETSC_COMM_WORLD, path2, some_provenance(), some_layout(4, 20));
  write_frame(file2, 0, 4);
  put(folder / "other", "another file");
  if (my_rank() == 0) rename((folder / "other").c_str(), path2.c_str());
  CHECK_THROWS_WITH(file2.close(), Contains("another file has taken its place"));
}

TEST_CASE("run file: readable after every single write, torn ones included", "[output][serial]") {
  const Folder folder;
  const std::string path = folder / "r.h5", copy = folder / "copy.h5";
  const std::size_t n = 700;  // a row crosses pages
  const int frames = 8;
  RunFile file(PETSC_COMM_WORLD, path, some_provenance(), some_layout(n, frames));
  write_frame(file, 0, n);
  std::string image = content(path);
  struct stat at {};
  REQUIRE(stat(path.c_str(), &at) == 0);
  record.clear();
  recording = true;
  std::vector<std::size_t> writes_after;  // how many writes had been made when a flush returned
  for (int k = 1; k < frames; ++k) {
    write_frame(file, k, n);
    file.flush();
    writes_after.push_back(record.size());
  }
  recording = false;
  const std::vector<Write> log = record;
  REQUIRE(log.size() > 50);

  int opened = 0, header_writes = 0;
  const auto check = [&](std::size_t writes_done) {
    put(copy, image);
    ++opened;
    const DataArray t = read_array("copy", copy, "t");
    int promised = 1;
    for (const std::size_t flushed : writes_after) promised += flushed <= writes_done;
    REQUIRE(static_cast<int>(t.values.size()) >= promised);
    for (std::size_t k = 0; k < t.values.size(); ++k) REQUIRE(t.values[k] == double(k));
    for (const char* name : {"psi", "eta"}) {
      const DataArray field = read_array("copy", copy, name);
      REQUIRE(field.shape.size() == 2);
      REQUIRE(field.shape[0] >= t.values.size());
      std::size_t wrong = 0;
      for (std::size_t k = 0; k < field.shape[0]; ++k)  // rows that t does not count yet are whole, too
        for (std::size_t i = 0; i < n; ++i)
          wrong += field.values[k * n + i] !=
                   (name[0] == 'p' ? psi_value(static_cast<int>(k), i) : eta_value(static_cast<int>(k), i));
      REQUIRE(wrong == 0);
    }
    for (const char* name : {"probes/psi", "series/psi_mean"})
      REQUIRE(read_array("copy", copy, name).shape[0] >=
              read_array("copy", copy, std::string(name, 6) + "/t").shape[0]);
    REQUIRE(frame_is_right(copy, static_cast<int>(t.values.size()) - 1, n));
  };
  for (std::size_t w = 0; w < log.size(); ++w) {
    REQUIRE(log[w].file == at.st_ino);
    const std::size_t offset = static_cast<std::size_t>(log[w].offset), size = log[w].bytes.size();
    REQUIRE(offset + size <= image.size());  // the file never grows
    if (offset < 32768) ++header_writes;
    // a kill takes effect between pages
    for (std::size_t page = (offset / 4096 + 1) * 4096; page < offset + size; page += 4096) {
      std::string torn = image;
      torn.replace(offset, page - offset, log[w].bytes, 0, page - offset);
      std::swap(image, torn);
      check(w);
      std::swap(image, torn);
    }
    image.replace(offset, size, log[w].bytes);
    check(w + 1);
  }
  CHECK(opened > static_cast<int>(log.size()));
  CHECK(header_writes >= 7 * 5);
  CHECK(image == content(path));
  file.close();
  CHECK(frame_is_right(path, frames - 1, n));
}

TEST_CASE("run file: a disk that fills is told, and what was written before is whole", "[output][serial]") {
  const Folder folder;
  const std::size_t n = 700;
  for (int room = 0; room < 30; ++room) {
    const std::string path = folder / ("r" + std::to_string(room) + ".h5");
    RunFile file(PETSC_COMM_WORLD, path, some_provenance(), some_layout(n, 1000));
    writes_left = room;
    std::string told;
    int k = 0;
    for (; k < 20 && told.empty(); ++k) {
      try {
        write_frame(file, k, n);
        file.flush();
      } catch (const Failure& e) {
        told = e.what();
      }
    }
    CHECK(told == "cannot write '" + path + "': No space left on device");
    CHECK_NOTHROW(file.close());
    writes_left = -1;
    if (k == 1) {
      CHECK(!present(path));  // not even one frame
      continue;
    }
    // the frame under way may be there when it was a row of probes or series that found no room
    const std::int64_t count = read_frame("x", path).count;
    CHECK((count == k - 1 || count == k));
    for (int j = 0; j < count; ++j) CHECK(frame_is_right(path, j, n));
    CHECK(!present(folder / ".r.h5.tmp"));
  }
}

TEST_CASE("run file: continued after an earlier one, its later rows replaced", "[output]") {
  const Folder folder;
  const std::string path = folder / "r.h5";
  const std::size_t n = 5;
  {
    RunFile file(PETSC_COMM_WORLD, path, some_provenance(), some_layout(n, 6));
    for (int k = 0; k < 6; ++k) write_frame(file, k, n);
    file.close();
  }
  RunLayout layout = some_layout(n, 12);
  layout.fields.push_back(standard_field("chi"));
  layout.groups[0].places = {0.5, 0.75};
  {
    RunFile file(PETSC_COMM_WORLD, path, some_provenance(), layout, RunFile::Resume{path, 3});
    CHECK(file.frames() == 4);
    CHECK(file.last_time() == 3);
    CHECK(read_frame("x", path).count == 6);  // the old file, until there is something new
    const std::vector<double> row(n, 7.5);
    file.row("probes", 3.5, {8, 9, 8, 9});
    file.frame(3.5, {row.data(), row.data(), row.data()});
    file.close();
  }
  CHECK(read_array("x", path, "t").values == std::vector<double>{0, 1, 2, 3, 3.5});
  CHECK(frame_is_right(path, 3, n));
  CHECK(read_frame("x", path, 4).fields.at("chi")[2] == 7.5);
  CHECK(std::isnan(read_frame("x", path, 3).fields.at("chi")[2]));
  const DataArray probes = read_array("x", path, "probes/psi");
  CHECK(probes.shape == std::vector<std::size_t>{5, 2});
  CHECK(probes.values[3 * 2] == 6);  // the probe at 0.5 has kept its past, the new one has none
  CHECK(std::isnan(probes.values[3 * 2 + 1]));
  CHECK(probes.values[4 * 2 + 1] == 9);
  CHECK(read_array("x", path, "series/t").values == std::vector<double>{0, 1, 2, 3});

  CHECK_THAT(usage_error([&] {
               const RunFile other(PETSC_COMM_WORLD, path, some_provenance(), some_layout(n + 1, 3),
                                   RunFile::Resume{path, 3});
             }),
             Contains("another grid"));
  CHECK(read_frame("x", path).count == 5);
}

TEST_CASE("run layout: coefficients, friction and stability of uniform sliding follow from the scene",
          "[output]") {
  const auto stable = [](const Scene& scene) { return run_layout(scene).numbers.at("steady_stable") == 1; };
  Scene scene;  // continuum, cubic: |v_c| = sqrt(1 - s delta/gamma)
  for (const bool derived : {true, false}) {
    scene.derived_sign = derived;
    const double critical = std::sqrt(1 - (derived ? 0.2 : -0.2) / 3);
    scene.v = critical - 1e-6;
    CHECK(!stable(scene));
    scene.v = -critical - 1e-6;
    CHECK(stable(scene));
  }
  const RunLayout layout = run_layout(scene);
  CHECK(layout.x(1) == scene.x(1));
  CHECK(layout.numbers.at("K1") == 1. / 3);
  CHECK(layout.numbers.at("s_delta") == -0.2);
  CHECK(layout.numbers.at("steady_eta") == Approx(scene.v * scene.v * scene.v / 3 - scene.v));
  const FixedTable& friction = layout.tables.at(0);
  const auto at = std::find(friction.at.begin(), friction.at.end(), 1.5);
  REQUIRE(at != friction.at.end());
  CHECK(friction.columns[0].second[std::size_t(at - friction.at.begin())] ==
        Approx(1.5 * 1.5 * 1.5 / 3 - 1.5));

  // Rate and state with inertia: stable iff K > (b - a) T/D [1 + v^2/(A a D T)] at every wavelength, T =
  // tanh(F/a)
  Scene chain;
  chain.form = Form::chain;
  chain.order = 2;
  chain.friction.law = Law("rate-and-state");
  chain.friction.state = StateLaw("ageing");
  chain.v = 0.1;
  chain.friction.values["friction_D"] = chain.friction.values["state_D"] = 1;
  const double a = chain.friction.value("friction_a"), b = chain.friction.value("friction_b");
  const double F = 0.6 + (a - b) * std::log(0.1), T = std::tanh(F / a);
  const double critical = (b - a) * T * (1 + 0.01 / (chain.A() * a * T));
  chain.k0 = critical * (1 + 1e-6);
  CHECK(stable(chain));
  chain.k0 = critical * (1 - 1e-6);
  CHECK(!stable(chain));
  CHECK(run_layout(chain).fields.back().name == "theta");
  chain.v = 0;
  CHECK(run_layout(chain).numbers.count("steady_stable") == 0);
}

TEST_CASE("result file: dimensions, groups, texts", "[output]") {
  const Folder folder;
  const std::string path = folder / "spectrum.h5";
  ResultFile file(PETSC_COMM_WORLD, path, some_provenance("spectrum"));
  file.attribute("growth_rate", 0.25);
  file.attribute("note", "all modes");
  file.scale({"x", "length", "position"}, {0, 1, 2});
  file.add({"psi", "length/time", "eigenvector"}, {"mode", "x"}, {1, 2, 3, 4, 5, 6});
  file.add({"re", "1/time", "real part"}, {"mode"}, {0.5, 0.25});
  file.scale({"branch/x", "length", "length of the ring"}, {10, 20});
  file.add({"branch/speed", "length/time", "speed"}, {"x"}, {3, 4});
  file.add({"residual", "1", "residual"}, {}, {1e-12});
  file.add_text({"method", "", "method"}, {"mode"}, {"rk:5dp", "arkimex:4"});
  file.write();
  CHECK(read_header("x", path).kind == "spectrum");
  CHECK(read_array("x", path, "psi").shape == std::vector<std::size_t>{2, 3});
  CHECK(read_array("x", path, "psi").values == std::vector<double>{1, 2, 3, 4, 5, 6});
  CHECK(read_array("x", path, "mode").values == std::vector<double>{0, 1});
  CHECK(read_array("x", path, "branch/speed").values == std::vector<double>{3, 4});
  CHECK_THAT(usage_error([&] { read_frame("init_file", path); }),
             Contains("the result of `spectrum`"));
  CHECK_THAT(usage_error([&] { read_array("init_file", path, "nope"); }),
             Contains("no dataset 'nope'"));
  CHECK_THAT(usage_error([&] { read_array("init_file", path, "method"); }),
             Contains("not hold numbers"));

  ResultFile wrong(PETSC_COMM_WORLD, folder / "w.h5", some_provenance("spectrum"));
  wrong.scale({"x", "length", "position"}, {0, 1, 2});
  wrong.add({"psi", "1", ""}, {"x"}, {1, 2});
  CHECK_THROWS(wrong.write());
  CHECK(!present(folder / "w.h5"));
  CHECK(!present(folder / ".w.h5.tmp"));
}

TEST_CASE("pieces: rank 0 gets what each rank gives, and what one rank throws all throw", "[output]") {
  const std::int64_t ranks = ranks_in(PETSC_COMM_WORLD), rank = rank_in(PETSC_COMM_WORLD);
  // Three rows of which each rank has a run longer than a piece, then a thousand short rows.
  const std::int64_t wide = largest_piece + 7, shorter = 5;
  std::vector<double> rows(std::size_t(3 * wide)), many(std::size_t(1000 * shorter));
  const auto value = [](std::int64_t list, std::int64_t row, std::int64_t at) {
    return double(list) + 1e-3 * double(row) + double(at);
  };
  for (std::int64_t r = 0; r < 3; ++r)
    for (std::int64_t i = 0; i < wide; ++i) rows[std::size_t(r * wide + i)] = value(1, r, rank * wide + i);
  for (std::int64_t r = 0; r < 1000; ++r)
    for (std::int64_t i = 0; i < shorter; ++i)
      many[std::size_t(r * shorter + i)] = value(2, 10 + r, rank * shorter + i);
  std::int64_t got = 0, longest = 0, calls = 0;
  bool right = true;
  const auto body = [&](const Give& give) {
    give({1, 0, 3, rank * wide, wide}, rows.data());
    give({2, 10, 1000, rank * shorter, shorter}, many.data());
  };
  collect(PETSC_COMM_WORLD, body, [&](const Piece& piece, const double* values) {
    const bool own = piece.first / (piece.list == 1 ? wide : shorter) == 0;  // rank 0's are handed on whole
    if (!own) longest = std::max(longest, piece.rows * piece.count);
    if (!own) ++calls;
    for (std::int64_t r = 0; r < piece.rows; ++r)
      for (std::int64_t i = 0; i < piece.count; ++i, ++got)
        right = right && *values++ == value(piece.list, piece.row + r, piece.first + i);
  });
  CHECK(right);
  CHECK(got == (rank == 0 ? ranks * (3 * wide + 1000 * shorter) : 0));
  CHECK(longest <= largest_piece);
  CHECK(calls == (rank == 0 ? (ranks - 1) * 7 : 0));

  const auto said = [&](auto&& work) {
    try {
      work();
    } catch (const Failure& e) {
      return std::string(e.what());
    }
    return std::string("nothing");
  };
  const auto last = [&] {
    if (rank == ranks - 1) throw std::runtime_error("the last rank");
  };
  CHECK(said([&] { together(PETSC_COMM_WORLD, last); }) == "the last rank");
  CHECK(said([&] { together(PETSC_COMM_WORLD, [] {}); }) == "nothing");
  CHECK_THROWS_AS(together(PETSC_COMM_WORLD, [] { throw UsageError("wrong"); }), UsageError);
  CHECK(said([&] { collect(PETSC_COMM_WORLD, [&](const Give&) { last(); }, {}); }) == "the last rank");
  const auto full = [](const Piece&, const double*) { throw Failure("no space"); };
  CHECK(said([&] { collect(PETSC_COMM_WORLD, body, full); }) == "no space");
}

TEST_CASE("checkpoint: exact to the last bit, damage found, the newest kept", "[output]") {
  const Folder folder;
  const std::string out = folder / "ring.h5";
  CHECK(checkpoint_name(out, 150) == folder / "ring.chk-000150.h5");
  CHECK(checkpoint_name("a.b/ring", 1234567) == "a.b/ring.chk-1234567.h5");
  const PetscInt n = 11, dof = 3;
  int ranks = 1;
  MPI_Comm_size(PETSC_COMM_WORLD, &ranks);
  const Slab slab = Slab::even(PETSC_COMM_WORLD, n);
  const NodeRange nodes{PETSC_COMM_WORLD, slab.first(), std::int64_t(slab.kept()), n};
  const auto value = [](std::int64_t i) {
    return std::sin(1.0 + double(i)) * std::pow(10.0, double(i % 7) - 300);
  };

  Checkpoint written;
  written.t = 1.0 / 3;
  written.dt = 1e-17 / 3;
  written.numbers = {{"rejections", 3}, {"error", 0.1}};
  written.texts = {{"method", "rk:5dp"}, {"out_file", out}};
  written.arrays = {{"events", {1, 2, 0.1}}, {"none", {}}};
  for (std::int64_t i = dof * nodes.first; i < dof * (nodes.first + nodes.count); ++i)
    written.fields["state"].push_back(value(i));
  for (std::int64_t i = nodes.first; i < nodes.first + nodes.count; ++i)
    written.fields["watch"].push_back(value(-i));
  std::string name;
  for (const std::int64_t step : {999, 100, 150, 200}) {  // the first as if of an older, longer run
    written.step = step;
    name = write_checkpoint(out, 2, some_provenance(), written, nodes);
    usleep(20000);  // the clock that stamps files is coarse
  }
  MPI_Barrier(PETSC_COMM_WORLD);
  CHECK(name == folder / "ring.chk-000200.h5");
  CHECK(!present(folder / "ring.chk-000999.h5"));
  CHECK(!present(folder / "ring.chk-000100.h5"));
  CHECK(present(folder / "ring.chk-000150.h5"));

  const Checkpoint read = read_checkpoint(name);
  CHECK(read.t == written.t);
  CHECK(read.dt == written.dt);
  CHECK(read.step == 200);
  CHECK(read.ranks == ranks);
  CHECK(read.numbers == written.numbers);
  CHECK(read.texts == written.texts);
  CHECK(read.arrays == written.arrays);
  CHECK(read.header.options == some_provenance().options);
  CHECK(read.field("state", nodes, dof) == written.fields.at("state"));
  CHECK(read.field("watch", nodes, 1) == written.fields.at("watch"));
  // dealt out in another way than it was written
  const NodeRange turned{PETSC_COMM_WORLD, n - nodes.first - nodes.count, nodes.count, n};
  const std::vector<double> other = read.field("state", turned, dof);
  bool right = true;
  for (std::size_t i = 0; i < other.size(); ++i)
    right = right && other[i] == value(dof * turned.first + std::int64_t(i));
  CHECK(right);
  CHECK_THROWS(read.field("state", nodes, dof + 1));
  CHECK_THROWS(read.field("none", nodes, 1));

  const auto damaged = [&](const std::string& bytes) {
    MPI_Barrier(PETSC_COMM_WORLD);
    put(folder / "d.h5", bytes);
    return usage_error([&] { read_checkpoint(folder / "d.h5"); });
  };
  const std::string good = content(name);
  CHECK(damaged(good) == "no error");
  for (const std::size_t at : {std::size_t(30), std::size_t(512), good.size() / 2, good.size() - 1}) {
    std::string bad = good;
    bad[at] = static_cast<char>(bad[at] ^ 0x10);
    CHECK_THAT(damaged(bad), Contains("is damaged"));
  }
  CHECK_THAT(damaged(good.substr(0, good.size() - 8)), Contains("is damaged"));
  CHECK_THAT(damaged(good.substr(0, 100)), Contains("is damaged"));
  CHECK_THAT(damaged(""), Contains("not a checkpoint"));
  CHECK_THAT(damaged("t: 3\n"), Contains("not a checkpoint"));
  CHECK_THAT(usage_error([&] { read_checkpoint(folder / "none.h5"); }),
             Contains("restart '" + (folder / "none.h5") + "': No such file"));
  CHECK_THAT(usage_error([&] { read_checkpoint(folder / ""); }), Contains("is not a file"));
}
