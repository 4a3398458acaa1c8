// Checkpoints: all that a run needs to go on, in HDF5 files beside out_file (ring.h5: ring.chk-000150.h5).
//
// A checkpoint is written under a hidden name, brought to disk (fsync) and renamed, so that one with its
// final name is whole. Its first 512 bytes, which HDF5 leaves to the user, carry a checksum of the rest: a
// damaged one is refused before HDF5 sees it. Every rank writes and reads the values of its own nodes
// (run_file.hpp says how); only rank 0 opens the file by the library.
#pragma once

#include <petscsys.h>
#include <petscvec.h>

#include <cstddef>
#include <cstdint>
#include <limits>
#include <map>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "stickslip/base/provenance.hpp"
#include "stickslip/model/model.hpp"
#include "stickslip/output/reader.hpp"

namespace stickslip {

// The nodes of this rank among all. Where every rank has all of them, rank 0 writes.
struct NodeRange {
  MPI_Comm comm = MPI_COMM_NULL;
  std::int64_t first = 0, count = 0, all = 0;
  static NodeRange of(const Model& model) {
    return {model.comm(), model.first(), model.local(), model.scene().n};
  }
};

struct Checkpoint {
  double t = 0, dt = 0;   // time reached, and the step that the method wants to take next
  std::int64_t step = 0;  // steps taken so far
  // Whatever else must survive, exact to the last bit: counters, settings of the method, tables under way.
  std::map<std::string, double> numbers;
  std::map<std::string, std::string> texts;
  std::map<std::string, std::vector<double>> arrays;
  // One value or several, the same number, for each node: to be written, those of this rank's nodes.
  std::map<std::string, std::vector<double>> fields;

  // Set by read_checkpoint only:
  FileHeader header;  // version, git and options of the run that wrote it
  int ranks = 1;      // on so many
  std::string path;

  // Of a checkpoint that was read, `each` values for every node of the range. Throws std::exception, on every
  // rank, where it has no field of that name and size. Collective. Of any other the field as it is.
  std::vector<double> field(const std::string& name, const NodeRange& nodes, int each) const;
};

// DIR/NAME.chk-STEP.h5 for out_file DIR/NAME.h5, the step in at least six digits.
std::string checkpoint_name(const std::string& out_file, std::int64_t step);

// Writes a checkpoint beside out_file (significant on rank 0: t, dt, step, numbers, texts, arrays), then
// removes the oldest files of that kind until `keep` are left; the one just written stays. Returns its name.
// Flush the RunFile first: a checkpoint must not be ahead of the frames. Collective; throws Failure, and then
// the checkpoints of before are all there.
std::string write_checkpoint(const std::string& out_file, std::int64_t keep, const Provenance& provenance,
                             const Checkpoint& checkpoint, const NodeRange& nodes);

// Every rank gets the same; fields are read by Checkpoint::field. Throws UsageError `restart 'PATH': ...` for
// what is damaged, senseless or of another version. Collective.
Checkpoint read_checkpoint(const std::string& path);

// What a checkpoint holds, said once for both directions: an archive is that of a checkpoint being written or
// of one that a run goes on from, and what is named to it is saved or restored.
//
//     void archive(Archive& a) override { a("fastest", psi_, t_); }
//
// An entry has a name of its own. It is a number, a list of numbers, or so many numbers for each node;
// integers and truth values stand there as numbers too. All are exact to the last bit. Every rank names the
// same entries, with the same numbers where nothing else is said. Restoring throws std::runtime_error, the
// same on every rank, where an entry is missing, has another size, or holds what its variable cannot.

// The numbers of a list, one behind the other.
class NumberList {
 public:
  // Numbers, and lists of them that have their size.
  template <class... T>
  void operator()(T&... values) {
    (take(values), ...);
  }
  // All items to the end of the list, each by body(item).
  template <class Item, class Body>
  void rest(std::vector<Item>& items, const Body& body) {
    if (restores_) items.clear();
    for (std::size_t k = 0; restores_ ? at_ < numbers_.size() : k < items.size(); ++k) {
      if (restores_) items.emplace_back();
      body(items[k]);
    }
  }
  void rest(std::vector<double>& numbers) {
    rest(numbers, [this](double& number) { take(number); });
  }
  void skip_rest() { at_ = numbers_.size(); }

 private:
  friend class Archive;
  NumberList(std::string name, std::vector<double> numbers, bool restores)
      : name_(std::move(name)), numbers_(std::move(numbers)), restores_(restores) {}

  template <class T>
  void take(std::vector<T>& values) {
    for (T& value : values) take(value);
  }
  template <class T>
  std::enable_if_t<std::is_arithmetic_v<T>> take(T& value) {
    if (!restores_) return numbers_.push_back(double(value));
    if constexpr (std::is_integral_v<T>)
      value = T(next_integer(double(std::numeric_limits<T>::min()), double(std::numeric_limits<T>::max())));
    else
      value = next();
  }
  double next();
  double next_integer(double least, double most);

  std::string name_;
  std::vector<double> numbers_;
  bool restores_;
  std::size_t at_ = 0;  // of those that are restored
};

class Archive {
 public:
  // `nodes`: those of this rank. What is saved is for write_checkpoint().
  static Archive to(Checkpoint& checkpoint, const NodeRange& nodes) { return {&checkpoint, nullptr, nodes}; }
  static Archive from(const Checkpoint& checkpoint, const NodeRange& nodes) {
    return {nullptr, &checkpoint, nodes};
  }

  bool restores() const { return from_ != nullptr; }
  double t() const { return to_ ? to_->t : from_->t; }  // of the checkpoint
  // Whether a list can be named: always while saving.
  bool has(const std::string& list) const { return to_ || from_->arrays.count(list) > 0; }

  // A number.
  template <class T>
  std::enable_if_t<std::is_arithmetic_v<T>> operator()(const std::string& name, T& value) {
    NumberList x = begin(name, false);
    x(value);
    end(x, false);
  }
  // A list of these numbers, and lists that have their size.
  template <class First, class Second, class... More>
  void operator()(const std::string& name, First& first, Second& second, More&... more) {
    list(name, [&](NumberList& x) { x(first, second, more...); });
  }
  // A list of any length.
  void operator()(const std::string& name, std::vector<double>& values) {
    list(name, [&](NumberList& x) { x.rest(values); });
  }
  // A list of what body(NumberList&) names.
  template <class Body>
  void list(const std::string& name, const Body& body) {
    NumberList x = begin(name, true);
    body(x);
    end(x, true);
  }

  // What a vector, distributed as the model's nodes, has for each node.
  void operator()(const std::string& name, Vec values);
  // In each list one value for each node of this rank.
  void nodes(const std::string& name, const std::vector<std::vector<double>*>& lists);

  // A list of `all` numbers, each of which some rank has as its own. Collective.
  struct Own {
    std::size_t place;  // in the list
    double* value;
  };
  void spread(const std::string& name, std::size_t all, const std::vector<Own>& own);
  // Numbers of each rank, as many on all: as many ranks take their own again, else rank 0 takes their sums.
  // Collective.
  void by_rank(const std::string& name, std::vector<double>& own);

 private:
  Archive(Checkpoint* to, const Checkpoint* from, const NodeRange& nodes)
      : to_(to), from_(from), nodes_(nodes) {}
  NumberList begin(const std::string& name, bool is_list) const;
  void end(NumberList& x, bool is_list);

  Checkpoint* to_;          // one of these
  const Checkpoint* from_;  // two
  NodeRange nodes_;
};

}  // namespace stickslip
