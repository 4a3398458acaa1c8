#include "stickslip/output/archive.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "base/broadcast.hpp"
#include "base/local_copy.hpp"

namespace stickslip {

namespace {

[[noreturn]] void does_not_fit(const std::string& name) {
  throw std::runtime_error("its '" + name + "' does not fit");
}

}  // namespace

double NumberList::next() {
  if (at_ == numbers_.size()) does_not_fit(name_);
  return numbers_[at_++];
}

double NumberList::next_integer(double least, double most) {
  const double value = next();
  if (!(value >= least && value <= most && value < 9e18 && value == std::floor(value))) does_not_fit(name_);
  return value;
}

NumberList Archive::begin(const std::string& name, bool is_list) const {
  if (to_) return {name, {}, false};
  if (const auto found = from_->arrays.find(name); is_list && found != from_->arrays.end())
    return {name, found->second, true};
  if (const auto found = from_->numbers.find(name); !is_list && found != from_->numbers.end())
    return {name, {found->second}, true};
  throw std::runtime_error("it has no '" + name + "'");
}

void Archive::end(NumberList& x, bool is_list) {
  if (from_ && x.at_ < x.numbers_.size()) does_not_fit(x.name_);
  if (to_ && is_list) to_->arrays[x.name_] = std::move(x.numbers_);
  if (to_ && !is_list) to_->numbers[x.name_] = x.numbers_[0];
}

void Archive::operator()(const std::string& name, Vec values) {
  if (to_) {
    to_->fields[name] = local_values(values);
    return;
  }
  PetscInt size;
  SS_TRY(VecGetLocalSize(values, &size));
  const std::vector<double> own = from_->field(name, nodes_, int(size / nodes_.count));
  std::copy(own.begin(), own.end(), static_cast<double*>(Writing(values)));
}

void Archive::nodes(const std::string& name, const std::vector<std::vector<double>*>& lists) {
  const std::size_t each = lists.size(), count = std::size_t(nodes_.count);
  std::vector<double> all(each * count);
  if (from_) all = from_->field(name, nodes_, int(each));
  for (std::size_t k = 0; k < each; ++k) {
    lists[k]->resize(count);
    for (std::size_t i = 0; i < count; ++i)
      (from_ ? (*lists[k])[i] : all[i * each + k]) = from_ ? all[i * each + k] : (*lists[k])[i];
  }
  if (to_) to_->fields[name] = std::move(all);
}

void Archive::spread(const std::string& name, std::size_t all, const std::vector<Own>& own) {
  std::vector<double> numbers(all);
  if (to_) {
    for (const Own& one : own) numbers[one.place] = *one.value;
    // every number has one owner, and elsewhere all its bits are 0
    SS_TRY(MPI_Allreduce(MPI_IN_PLACE, numbers.data(), int(all), MPI_UINT64_T, MPI_BOR, nodes_.comm));
  }
  list(name, [&](NumberList& x) { x(numbers); });
  for (const Own& one : own) *one.value = numbers[one.place];
}

void Archive::by_rank(const std::string& name, std::vector<double>& own) {
  const std::size_t size = own.size(), ranks = std::size_t(ranks_in(nodes_.comm));
  std::vector<double> all(to_ ? size * ranks : 0);
  if (to_)
    SS_TRY(MPI_Allgather(own.data(), int(size), MPI_DOUBLE, all.data(), int(size), MPI_DOUBLE, nodes_.comm));
  (*this)(name, all);
  if (to_) return;
  if (size == 0 ? !all.empty() : all.size() % size != 0) does_not_fit(name);
  if (size == 0) return;
  const std::size_t rank = std::size_t(rank_in(nodes_.comm));
  own.assign(size, 0.);
  for (std::size_t k = 0; k < all.size(); ++k)
    if (rank == (all.size() == size * ranks ? k / size : 0)) own[k % size] += all[k];
}

}  // namespace stickslip
