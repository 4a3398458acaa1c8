// The rows of the fields of a run's file that every rank writes for its own nodes (slab.hpp).
#pragma once

#include <vector>

#include "output/growing_table.hpp"
#include "output/shared_file.hpp"
#include "stickslip/output/slab.hpp"

namespace stickslip {

class NodeRows {
 public:
  // Collective, like open() and write().
  NodeRows(MPI_Comm comm, const Slab& slab, std::size_t fields, bool by_root)
      : comm_(comm), slab_(slab), places_(fields), pending_(fields), file_(comm, by_root) {}

  // The file and where its columns lie (significant on rank 0), before the first row and whenever they have
  // changed.
  void open(const std::string& path, const std::vector<h5::ColumnPlace>& places);
  // A row to be kept in memory: of each field what this rank has.
  void append(const std::vector<const double*>& row);
  // Writes the rows in memory and then `last`, if given, from row `first` of the file on. Throws Failure, on
  // every rank.
  void write(std::int64_t first, const std::vector<const double*>* last);
  void close() { file_.close(); }

 private:
  void put_rows(std::size_t field, hsize_t first, hsize_t count, const double* values,
                const SharedFile::Put& put) const;

  MPI_Comm comm_;
  Slab slab_;
  std::vector<h5::ColumnPlace> places_;
  std::vector<std::vector<double>> pending_;  // of each field
  hsize_t rows_ = 0;                          // in memory
  SharedFile file_;
};

}  // namespace stickslip
