#include "stickslip/options/library_options.hpp"

#include <slepcsys.h>

#include <dlfcn.h>
#include <link.h>

#include <algorithm>
#include <cctype>
#include <regex>
#include <set>
#include <string_view>

#include "stickslip/base/text.hpp"

namespace stickslip {

namespace {

// The read-only data of the libraries: segments of their images in memory that are neither written nor run.
std::vector<std::string_view> constants_of_libraries() {
  struct NameScan {
    std::set<std::string> files;
    std::vector<std::string_view> found;
  } search;
  for (const auto function : {(void*)&PetscInitialize, (void*)&SlepcInitialize}) {
    Dl_info where;
    if (dladdr(function, &where)) search.files.insert(where.dli_fname);
  }
  const auto visit = [](dl_phdr_info* image, std::size_t, void* data) {
    NameScan& wanted = *static_cast<NameScan*>(data);
    Dl_info where;  // the program's own image has no name here
    const bool is_named = image->dlpi_name && *image->dlpi_name;
    const char* name = is_named ? image->dlpi_name : "";
    if (!is_named && dladdr((void*)&library_names, &where)) name = where.dli_fname;
    if (!wanted.files.count(name)) return 0;
    for (int i = 0; i < image->dlpi_phnum; ++i) {
      const auto& segment = image->dlpi_phdr[i];
      if (segment.p_type == PT_LOAD && segment.p_flags == PF_R)
        wanted.found.emplace_back(reinterpret_cast<const char*>(image->dlpi_addr + segment.p_vaddr),
                                  segment.p_memsz);
    }
    return 0;
  };
  dl_iterate_phdr(visit, &search);
  return search.found;
}

std::set<std::string>& added_names() {
  static std::set<std::string> names;
  return names;
}

bool in_name(char c) { return std::isalnum(static_cast<unsigned char>(c)) || c == '_'; }

std::vector<std::string> read_names() {
  std::set<std::string> names = added_names();
  for (const std::string_view text : constants_of_libraries())
    for (auto at = text.find('-'); at != text.npos; at = text.find('-', at + 1)) {
      std::size_t end = at + 1;
      while (end < text.size() && in_name(text[end])) ++end;
      const std::string_view name = text.substr(at + 1, end - at - 1);
      if (end < text.size() && text[end] == 0 && name.find('_') != name.npos &&
          std::isalpha(static_cast<unsigned char>(name[0])))
        names.insert(lower_case(std::string(name)));
    }
  return {names.begin(), names.end()};
}

bool stands_there(const std::string& name) {
  const auto& names = library_names();
  return std::binary_search(names.begin(), names.end(), name);
}

}  // namespace

void add_library_name(const std::string& name) { added_names().insert(lower_case(name)); }

const std::vector<std::string>& library_names() {
  static const std::vector<std::string> names = read_names();
  return names;
}

std::string without_nesting(const std::string& name) {
  static const std::regex inner(
      "(st_|sub_|redundant_|redistribute_|telescope_|galerkin_|exotic_|npc_|esteig_|inner_|pc_gamg_esteig_|"
      "(mg|fas)_(levels|coarse)_([0-9]+_)?|fieldsplit_[a-z0-9]+_|fetidp_bddc_|eps_ciss_|eps_lyapii_|"
      "pep_linear_|pep_refine_|(mat|pc)_lmvm_(j0_)?|snes_(?=ksp_ew_)|qn_(?=mat_)|ksp_(?=(ksp|pc)_))");
  std::string own = name;
  std::smatch found;
  while (!stands_there(own) && std::regex_search(own, found, inner, std::regex_constants::match_continuous))
    own = std::string(found.suffix());
  return own;
}

bool library_reads(const std::string& name) { return stands_there(without_nesting(name)); }

}  // namespace stickslip
