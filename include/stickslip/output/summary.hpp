// The summary of a command as one JSON object: what `-summary FILE` writes (`-`: standard output).
//
// All keys are there from the start, null until set, so that the object has the same keys whatever happens. A
// command sets them as it learns them and runs its body inside with_summary(), which also writes the summary
// of a computation that failed. Every rank holds the same values; rank 0 writes.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "stickslip/base/provenance.hpp"

namespace stickslip {

// A key of a summary: its name, its unit in words ("length/time"; "" where it has none, or several), and its
// meaning in Markdown, for docs/summary.md.
struct SummaryKey {
  std::string name, unit = {}, meaning = {};
};
std::vector<SummaryKey> common_quantities();  // of every command

class Summary {
 public:
  // `keys`: the command's own, in the order in which they are to appear after the common ones. `path`: the
  // text of option `summary`, "" for none. Throws UsageError, on every rank, where `path` cannot be written.
  // Collective.
  Summary(const Provenance& provenance, const std::vector<SummaryKey>& keys, std::string path);
  ~Summary();
  Summary(const Summary&) = delete;
  Summary& operator=(const Summary&) = delete;

  // Sets one of the keys given to the constructor (any other is a mistake in the program: std::logic_error).
  // Numbers, truth, texts, lists of them and optional ones (null where there is none) as they are: the types
  // that summary.cpp names. Anything else as Json, the values of src/base/json_values.hpp.
  template <class T>
  void set(const std::string& key, const T& value);
  void set(const std::string& key, const char* text);
  template <class Json>
  const Json& get(const std::string& key) const;
  bool is_null(const std::string& key) const;

  void done();                              // status `done`
  void failed(const std::string& reason);   // status `failed`
  void stopped(const std::string& reason);  // status `stopped`: by what `reason` names, before the end

  // A file that this command has written: joins key `files`. The out_file of a command that is done joins by
  // itself.
  void wrote(const std::string& path);
  // A line for a person, to be shown by tell().
  void say(const std::string& line);
  // Shows what was said, the seconds, the files, and what to look at next, on standard error, unless option
  // `progress` is off.
  void tell() const;

  // The whole object, warnings and seconds up to now included.
  std::string text() const;

  // Writes it where it belongs, whole or not at all (a file is replaced by a rename); nothing where no
  // summary was asked for. Throws Failure. Collective.
  void write() const;

  // Writes from this rank alone, swallowing every error: for a failure that the other ranks may not know of.
  void write_alone() const noexcept;

 private:
  struct Object;
  void write_from_here() const;

  std::unique_ptr<Object> object_;
  std::string path_, out_file_;
  std::vector<std::string> lines_;
  bool silent_;
};

// Throws UsageError, on every rank, where option `summary` with this text could not be written at the end: an
// empty name, a folder, a missing or unwritable folder, or an existing file that does not hold a JSON object
// (a summary of old is replaced, a scene that was typed in its place is not). Collective.
void check_summary_path(const std::string& path);

// Runs the body of a command, which returns the exit code: 0 (status `done`, unless the body set another) or
// that of a signal it stopped for. Then writes the summary and tells a person. An exception other than
// UsageError is put into it as status `failed` and goes on to main(); a signal that ends a search
// (base/pulse.hpp) is status `stopped`. Collective.
template <class Body>
int with_summary(Summary& summary, Body&& body);

// Implementation.
namespace detail {
// Called in a catch block. The exit code of a search that a signal ended, which the one rank there is leaves
// in order; 0: the exception goes on to main().
int summarise_exception(Summary& summary) noexcept;
}  // namespace detail

template <class Body>
int with_summary(Summary& summary, Body&& body) {
  int code = 0;
  try {
    code = body();
  } catch (...) {
    if (const int stopped = detail::summarise_exception(summary)) return stopped;
    throw;
  }
  if (summary.is_null("status")) summary.done();
  summary.write();
  summary.tell();
  return code;
}

}  // namespace stickslip
