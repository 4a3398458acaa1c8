// A file written in one piece: spectrum, boundary, wave, chart, laws, sweep. Collect on every rank or on rank
// 0, write() is collective. Names may have one group before them ("branch/speed"); a dimension is named by
// its scale, which is sought in the dataset's group first, then at the root. A dimension without a scale gets
// one that counts 0, 1, ...
#pragma once

#include <petscsys.h>

#include <complex>
#include <memory>
#include <string>
#include <vector>

#include "stickslip/base/provenance.hpp"
#include "stickslip/output/field.hpp"

namespace stickslip {

class ResultFile {
 public:
  ResultFile(MPI_Comm comm, std::string path, Provenance provenance);  // path "": write() does nothing
  ~ResultFile();
  ResultFile(const ResultFile&) = delete;
  ResultFile& operator=(const ResultFile&) = delete;

  void attribute(const std::string& name, const std::string& text);
  void attribute(const std::string& name, double value);
  void scale(const Field& field, std::vector<double> values);
  void scale_text(const Field& field, std::vector<std::string> values);
  // Row-major values of the named dimensions, none of them for a scalar.
  void add(const Field& field, const std::vector<std::string>& dimensions, std::vector<double> values);
  void add_text(const Field& field, const std::vector<std::string>& dimensions,
                std::vector<std::string> values);
  // Two, NAME_re and NAME_im.
  void add_complex(const Field& field, const std::vector<std::string>& dimensions,
                   const std::vector<std::complex<double>>& values);
  void write();  // throws Failure

 private:
  struct Contents;
  MPI_Comm comm_;
  std::string path_;
  Provenance provenance_;
  std::unique_ptr<Contents> contents_;
};

}  // namespace stickslip
