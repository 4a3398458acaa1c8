#include "commands/wave_limits.hpp"

#include "commands/wave_options.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/base/json_values.hpp"
#include "stickslip/waves/train_limits.hpp"

namespace stickslip {

namespace {

Json limit_list(const std::vector<TrainLimit>& limits, bool two) {
  Json list = Json::array();
  for (const TrainLimit& limit : limits)
    list.push_back(Json::object({{"kind", limit.kind},
                                 {"value", limit.value},
                                 {"value2", two ? Json(limit.value2) : Json()},
                                 {"frequency", limit.frequency},
                                 {"wavenumber", limit.wavenumber},
                                 {"bloch", limit.bloch},
                                 {"speed", limit.speed},
                                 {"length", limit.length},
                                 {"period", limit.period},
                                 {"leads", limit.leads ? Json(*limit.leads) : Json()}}));
  return list;
}

void describe(Summary& summary, const std::string& name, const TrainLimit& limit) {
  summary.say((limit.kind == "fold" ? "fold"
                                    : "stability changes (" + limit.kind + ", Bloch number " +
                                          std::to_string(limit.bloch) + ")") +
              " at " + name + " = " + rounded_text(limit.value, 10) +
              (limit.leads.value_or(true) ? "" : ", where other modes grow already"));
}

void write_curves(ResultFile& file, const std::vector<TrainLimitCurve>& curves, const std::string& name,
                  const std::string& name2) {
  std::map<std::string, std::vector<double>> columns;
  std::vector<std::string> kinds;
  for (std::size_t k = 0; k < curves.size(); ++k)
    for (const TrainLimit& limit : curves[k].points) {
      columns["value"].push_back(limit.value);
      columns["value2"].push_back(limit.value2);
      columns["piece"].push_back(double(k));
      columns["frequency"].push_back(limit.frequency);
      columns["wavenumber"].push_back(limit.wavenumber);
      columns["leads"].push_back(limit.leads.value_or(false));
      kinds.push_back(limit.kind);
    }
  file.attribute("branch_parameter2", name2);
  if (kinds.empty()) return;
  const auto unit = [](const std::string& option) { return find_option(option)->unit; };
  const std::map<std::string, Field> fields = {
      {"value", {"curves/value", unit(name), name}},
      {"value2", {"curves/value2", unit(name2), name2}},
      {"piece", {"curves/piece", "1", "number of the curve"}},
      {"frequency", {"curves/frequency", "1/time", "of the mode that crosses, in the frame of the train"}},
      {"wavenumber", {"curves/wavenumber", "1/length", "of its Bloch factor"}},
      {"leads", {"curves/leads", "1", "1 where no other mode grows"}}};
  for (const auto& [key, values] : columns) file.add(fields.at(key), {"curves/point"}, values);
  file.add_text({"curves/kind", "1", "fold, hopf or zero"}, {"curves/point"}, kinds);
}

}  // namespace

void add_limits(Summary& summary, ResultFile& file, const Options& options, const Branch& branch) {
  const std::string name = options.text("wave_continue"), name2 = options.text("wave_continue2");
  const bool two = options.is_set("wave_continue2");
  std::vector<std::string> notes;
  if (!two) {
    const std::vector<TrainLimit> limits =
        train_limits(train_family(options, name, name), branch, 0, options.boolean("wave_spectrum"), notes);
    for (const std::string& note : notes) warn(note);
    summary.set("special", limit_list(limits, false));
    for (const TrainLimit& limit : limits) describe(summary, name, limit);
    return;
  }
  const double from2 = options.real(name2), to2 = options.real("wave_to2");
  const std::vector<TrainLimitCurve> curves =
      train_limit_curves(train_family(options, name, name2), branch, options.real(name),
                         options.real("wave_to"), from2, to2, int(options.integer("wave_steps")), notes);
  for (const std::string& note : notes) warn(note);
  Json list = Json::array();
  std::vector<TrainLimit> limits;
  for (const TrainLimitCurve& curve : curves) {
    limits.push_back(curve.points.front());
    list.push_back(Json::object({{"kind", curve.points.front().kind},
                                 {"points", limit_list(curve.points, true)},
                                 {"end", curve.end}}));
    describe(summary, name, curve.points.front());
    summary.say("  followed in " + name2 + ": " + std::to_string(curve.points.size()) + " points; " +
                curve.end);
  }
  summary.set("special", limit_list(limits, true));
  summary.set("curves", list);
  write_curves(file, curves, name, name2);
}

}  // namespace stickslip
