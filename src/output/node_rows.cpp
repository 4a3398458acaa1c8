#include "output/node_rows.hpp"

#include "base/broadcast.hpp"

namespace stickslip {

void NodeRows::open(const std::string& path, const std::vector<h5::ColumnPlace>& places) {
  for (std::size_t k = 0; k < places_.size(); ++k) {
    if (!places.empty()) places_[k] = places[k];
    broadcast(places_[k].wide, comm_);
    broadcast(places_[k].chunk_width, comm_);
    broadcast(places_[k].chunks, comm_);
  }
  file_.open(path);
}

void NodeRows::append(const std::vector<const double*>& row) {
  for (std::size_t k = 0; k < row.size(); ++k)
    pending_[k].insert(pending_[k].end(), row[k], row[k] + slab_.kept());
  ++rows_;
}

void NodeRows::write(std::int64_t first, const std::vector<const double*>* last) {
  file_.write([&](const SharedFile::Put& put) {
    for (std::size_t k = 0; k < pending_.size(); ++k) {
      put_rows(k, hsize_t(first), rows_, pending_[k].data(), put);
      if (last) put_rows(k, hsize_t(first) + rows_, 1, (*last)[k], put);
    }
  });
  rows_ = 0;
  for (std::vector<double>& values : pending_) values.clear();
}

void NodeRows::put_rows(std::size_t field, hsize_t first, hsize_t count, const double* values,
                        const SharedFile::Put& put) const {
  const h5::ColumnPlace& place = places_[field];
  if (slab_.is_one_run() && slab_.kept() == place.wide) return place.put_rows(first, count, values, put);
  for (hsize_t r = 0; r < count; ++r)
    slab_.place(values + r * slab_.kept(), [&](std::int64_t node, std::int64_t nodes, const double* part) {
      place.put_row(first + r, hsize_t(node), hsize_t(nodes), part, put);
    });
}

}  // namespace stickslip
