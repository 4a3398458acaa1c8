// How the rows of the option table are written (option_table.cpp).
#pragma once

#include <functional>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "stickslip/options/options.hpp"

namespace stickslip {

// What else a row says, in words that can be strung together.
class OptionRow {
 public:
  explicit OptionRow(OptionSpec& spec) : spec_(spec) {}
  OptionRow& at_least(double low) {
    spec_.low = low;
    return *this;
  }
  OptionRow& above(double low) {
    spec_.open_low = true;
    return at_least(low);
  }
  OptionRow& at_most(double high) {
    spec_.high = high;
    return *this;
  }
  OptionRow& words(std::vector<std::string> list) {
    spec_.words = std::move(list);
    return *this;
  }
  OptionRow& unit(const char* text) {
    spec_.unit = text;
    return *this;
  }
  OptionRow& read_by(const char* commands) {
    spec_.commands = commands;
    return *this;
  }
  // What holds where it is unset, in words; and as a text, where it depends on other options.
  OptionRow& unset(const char* help, std::function<std::string(const Options&)> value = nullptr) {
    spec_.default_text = "";
    spec_.default_help = help;
    spec_.default_of = std::move(value);
    return *this;
  }
  // It changes something only where another option has one of these values ("": is set), and says else what
  // that option is.
  OptionRow& where(const char* other, std::vector<std::string> values) {
    spec_.idle_of = [name = std::string(other), list = std::move(values)](const Options& o) {
      const bool flag = find_option(name)->type == OptionType::boolean;
      const std::string text = flag ? (o.boolean(name) ? "true" : "false") : o.text(name),
                        is = " is " + (text.empty() ? "not set" : text);
      for (const std::string& value : list)
        if (value.empty() ? !text.empty() : text == value) return std::string();
      return name + is;
    };
    return *this;
  }
  OptionRow& where_not_zero(const char* other) {
    spec_.idle_of = [name = std::string(other)](const Options& o) {
      return o.real(name) == 0 ? name + " is 0" : "";
    };
    return *this;
  }
  OptionRow& idle_of(std::function<std::string(const Options&)> reason) {
    spec_.idle_of = std::move(reason);
    return *this;
  }

 private:
  OptionSpec& spec_;
};

// Builds the table; `in` gives the heading and the readers of the options that follow.
class OptionTableBuilder {
 public:
  std::vector<OptionSpec> rows;

  void in(const char* group, const char* commands) {
    group_ = group;
    commands_ = commands;
  }
  OptionRow add(OptionSpec spec) {
    spec.group = group_;
    spec.commands = commands_;
    rows.push_back(std::move(spec));
    return OptionRow(rows.back());
  }
  OptionRow add(const char* name, OptionType type, const char* value, const char* help) {
    return add({name, type, value, "", "", -all, all, false, {}, help, "", ""});
  }
  OptionRow real(const char* name, const char* value, const char* help, const char* unit = "") {
    return add(name, OptionType::real, value, help).unit(unit);
  }
  OptionRow positive(const char* name, const char* value, const char* help, const char* unit = "") {
    return real(name, value, help, unit).above(0);
  }
  OptionRow not_negative(const char* name, const char* value, const char* help, const char* unit = "") {
    return real(name, value, help, unit).at_least(0);
  }
  OptionRow reals(const char* name, const char* help, const char* unit = "") {
    return add(name, OptionType::real_list, "", help).unit(unit);
  }
  OptionRow integer(const char* name, const char* value, double low, double high, const char* help) {
    return add(name, OptionType::integer, value, help).at_least(low).at_most(high);
  }
  OptionRow integers(const char* name, double low, double high, const char* help) {
    return add(name, OptionType::integer_list, "", help).at_least(low).at_most(high);
  }
  OptionRow boolean(const char* name, const char* value, const char* help) {
    return add(name, OptionType::boolean, value, help);
  }
  OptionRow text(const char* name, const char* value, const char* help) {
    return add(name, OptionType::text, value, help);
  }
  OptionRow choice(const char* name, std::vector<std::string> words, const char* help) {
    return add(name, OptionType::choice, words[0].c_str(), help).words(words);
  }
  OptionRow real_or(const char* name, const char* word, const char* value, const char* help,
                    const char* unit = "") {
    return add(name, OptionType::real_or_word, value, help).words({word}).unit(unit);
  }

 private:
  static constexpr double all = std::numeric_limits<double>::infinity();
  std::string group_, commands_;
};

}  // namespace stickslip
