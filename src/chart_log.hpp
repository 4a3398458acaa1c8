// What is already known of a chart, in a file beside its out_file (NAME.rows.jsonl): one JSON object of texts a line, the
// first of them the options, the version and the ranks. A line is written when its row is done; a torn last line is as
// good as none. The same command goes on where it was; another one begins anew and says what differs. Collective.
#pragma once

#include <cstdio>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "stickslip/options.hpp"
#include "stickslip/provenance.hpp"

namespace stickslip {

using Texts = std::map<std::string, std::string>;

class ChartLog {
 public:
  // Without an out_file nothing is kept.
  ChartLog(const Options& options, const Provenance& provenance);
  ~ChartLog();
  ChartLog(const ChartLog&) = delete;
  ChartLog& operator=(const ChartLog&) = delete;

  const std::vector<Texts>& lines() const { return lines_; }  // after the first
  void add(const Texts& line);                                // throws Failure where it cannot be written
  void remove();                                              // the chart is complete

 private:
  void read(const Texts& identity, std::string& differs);
  void write(const Texts& line);

  std::string path_;
  std::vector<Texts> lines_;
  std::FILE* file_ = nullptr;
  int rank_ = 0, failed_ = 0;
};

// Whether rows may be taken over: the first differing option, or "".
std::string chart_difference(const Texts& stored, const Texts& now);

// Numbers as texts, to the last bit; "" is no number.
double number_of(const std::string& text);
std::vector<double> numbers_of(const std::string& text);
std::string numbers_text(const std::vector<double>& values);
std::string optional_text(const std::optional<double>& value);
std::optional<double> optional_of(const std::string& text);

}  // namespace stickslip
