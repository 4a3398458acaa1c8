// How far long work is: one line on standard error, written anew about twice a second on a terminal and every
// five seconds elsewhere, by rank 0 alone. `progress` is on, off or auto (on a terminal only). Not
// collective.
#pragma once

#include <petscsys.h>

#include <string>

namespace stickslip {

class Progress {
 public:
  // `wish`: the option `progress`, on, off or auto; `what` stands before every line ("chart: ").
  Progress(const std::string& wish, std::string what);
  ~Progress();  // the line goes, so that what follows stands alone
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  // Whether it is time for another line, so that text is made only when it is shown.
  bool due() const;
  void show(const std::string& text);
  void tell(const std::string& text) const;  // a line that stays
  // ", 12 s left" if `part` of the work (0 to 1) took the time since restart_clock or the start; "" at the
  // beginning.
  std::string left(double part) const;
  void restart_clock();

 private:
  std::string what_;
  double begin_, last_;
  bool on_ = false, terminal_ = false, shown_ = false;
};

}  // namespace stickslip
