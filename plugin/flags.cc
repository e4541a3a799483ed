// SPDX-License-Identifier: BSD-3-Clause
#include "plugin/flags.h"

#include "plugin/config_file.h"
#include "plugin/version.h"
#include "scene/error.h"

#include <algorithm>
#include <cstdio>
#include <map>
#include <new>
#include <numeric>

#include <CLI/CLI.hpp>

namespace vgtw {

struct Flags::Impl {
  CLI::App* app = nullptr;
  std::string group = "Options";
  bool has_config = false;
};

namespace {

constexpr int kExitFailed = 1;
constexpr int kExitUsage = 2;

template <typename T>
void AddOption(Flags::Impl& impl, std::string_view name, T* value, std::string_view help) {
  impl.app->add_option("--" + std::string(name), *value, std::string(help))
      ->group(impl.group)
      ->capture_default_str()
      ->take_last();
}

size_t EditDistance(std::string_view a, std::string_view b) {
  std::vector<size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), size_t{0});
  for (size_t i = 0; i < a.size(); ++i) {
    size_t diagonal = row[0]++;
    for (size_t j = 0; j < b.size(); ++j) {
      const size_t substitution = diagonal + (a[i] == b[j] ? 0 : 1);
      diagonal = row[j + 1];
      row[j + 1] = std::min({row[j + 1] + 1, row[j] + 1, substitution});
    }
  }
  return row.back();
}

// "; did you mean '--image_path'?" for a word that is close to one that exists.
std::string Suggest(const std::string& word, const std::vector<std::string>& known) {
  std::string best;
  size_t best_distance = word.size() / 3 + 1;
  for (const std::string& candidate : known) {
    const size_t distance = EditDistance(word, candidate);
    if (distance > best_distance) continue;
    best_distance = distance;
    best = candidate;
  }
  return best.empty() ? "" : "; did you mean '" + best + "'?";
}

// The sub-command that the command line has reached.
const CLI::App* Innermost(const CLI::App* app) {
  while (!app->get_subcommands().empty()) app = app->get_subcommands().front();
  return app;
}

std::string FullName(const CLI::App* app) {
  std::string name = app->get_name();
  for (app = app->get_parent(); app != nullptr; app = app->get_parent()) {
    name = app->get_name() + " " + name;
  }
  return name;
}

int ReportUsage(const CLI::App& program, const CLI::ParseError& error) {
  const CLI::App* app = Innermost(&program);
  std::string message = error.what();
  if (dynamic_cast<const CLI::ExtrasError*>(&error) != nullptr) {
    std::vector<std::string> known;
    for (const CLI::Option* option : app->get_options()) known.push_back(option->get_name());
    for (const CLI::App* sub : app->get_subcommands([](const CLI::App*) { return true; })) {
      known.push_back(sub->get_name());
    }
    const std::vector<std::string> extras = program.remaining(/*recurse=*/true);
    const std::string word = extras.empty() ? "" : extras.front();
    message = "unknown argument '" + Printable(word) + "'" + Suggest(word, known);
  }
  std::fprintf(stderr,
               "%s: %s (see '%s --help')\n",
               FullName(app).c_str(),
               message.c_str(),
               FullName(app).c_str());
  return kExitUsage;
}

int Fail(const CLI::App& program, const std::string& message) {
  std::fprintf(stderr, "%s: %s\n", FullName(Innermost(&program)).c_str(), message.c_str());
  return kExitFailed;
}

class Program {
 public:
  explicit Program(const std::vector<Command>& commands)
      : app_(
            "Distractor-free structure-from-motion: feed-forward predictions in, a COLMAP\n"
            "reconstruction of the static scene out.\n",
            "vgtw") {
    app_.set_version_flag("--version", std::string("vgtw ") + kVersion);
    app_.footer(
        "Start with 'vgtw doctor' (what is here) and 'vgtw demo' (all of it, on a made scene).");
    app_.require_subcommand(0, 1);
    for (const Command& command : commands) Add(command);
  }

  int Run(int argc, char** argv) {
    try {
      std::vector<std::string> arguments = WithConfig({argv + 1, argv + argc});
      std::reverse(arguments.begin(), arguments.end());  // as CLI11 takes them
      app_.parse(std::move(arguments));
    } catch (const CLI::CallForHelp&) {
      std::fputs(Innermost(&app_)->help().c_str(), stdout);
      return 0;
    } catch (const CLI::CallForVersion& version) {
      std::printf("%s\n", version.what());
      return 0;
    } catch (const CLI::ParseError& error) {
      return ReportUsage(app_, error);
    } catch (const Error& error) {
      return Fail(app_, error.what());
    }
    // Asked for here and not by CLI11, which would not tell a misspelt command from none.
    const auto work = works_.find(Innermost(&app_));
    if (work == works_.end()) {
      return ReportUsage(app_, CLI::RequiredError("A command"));
    }
    try {
      work->second(argc, argv);
      return 0;
    } catch (const Error& error) {
      return Fail(app_, error.what());
    } catch (const std::bad_alloc&) {
      return Fail(app_, "out of memory; use fewer --threads or smaller images");
    } catch (const std::invalid_argument& error) {
      return Fail(app_, std::string("invalid option: ") + error.what());
    } catch (const std::exception& error) {
      return Fail(app_, std::string("internal error: ") + error.what());
    }
  }

 private:
  // The words of a command line, followed by the flags of the file that --config names.
  std::vector<std::string> WithConfig(std::vector<std::string> arguments) const {
    const auto is_called = [&](const std::unique_ptr<Flags::Impl>& impl) {
      return impl->has_config && !arguments.empty() && impl->app->get_name() == arguments.front();
    };
    const std::filesystem::path config = FindConfig(arguments);
    if (config.empty() || std::none_of(impls_.begin(), impls_.end(), is_called)) return arguments;
    const std::vector<std::string> flags = FlagsOfConfig(config, arguments);
    arguments.insert(arguments.end(), flags.begin(), flags.end());
    return arguments;
  }

  CLI::App& Group(const std::string& name, std::string_view summary) {
    CLI::App*& group = groups_[name];
    if (group == nullptr) {
      group = app_.add_subcommand(name, std::string(summary));
      group->require_subcommand(0, 1);
    }
    return *group;
  }

  void Add(const Command& command) {
    CLI::App* parent = &app_;
    std::string name(command.name);
    if (!command.declare && !command.forward) {
      Group(name, command.summary);
      return;
    }
    if (const size_t space = name.find(' '); space != std::string::npos) {
      parent = &Group(name.substr(0, space), "");
      name = name.substr(space + 1);
    }
    CLI::App* app = parent->add_subcommand(name, std::string(command.summary));
    if (command.forward) {
      // Everything behind the command's name, --help too, is the other program's.
      app->set_help_flag();
      app->prefix_command();
      works_[app] = command.forward;
      return;
    }
    if (!command.examples.empty()) app->footer("Examples:\n" + std::string(command.examples));
    impls_.push_back(std::make_unique<Flags::Impl>());
    impls_.back()->app = app;
    Flags flags(impls_.back().get());
    works_[app] = [work = command.declare(flags)](int, char**) { work(); };
  }

  CLI::App app_;
  std::map<std::string, CLI::App*> groups_;
  std::vector<std::unique_ptr<Flags::Impl>> impls_;
  std::map<const CLI::App*, ForwardCommand> works_;
};

}  // namespace

Flags& Flags::Group(std::string name) {
  impl_->group = std::move(name);
  return *this;
}

Flags& Flags::Add(std::string_view name, std::string* value, std::string_view help) {
  AddOption(*impl_, name, value, help);
  return *this;
}

Flags& Flags::Add(std::string_view name, std::filesystem::path* value, std::string_view help) {
  AddOption(*impl_, name, value, help);
  return *this;
}

Flags& Flags::Add(std::string_view name, int* value, std::string_view help) {
  AddOption(*impl_, name, value, help);
  return *this;
}

Flags& Flags::Add(std::string_view name, std::vector<int64_t>* value, std::string_view help) {
  impl_->app->add_option("--" + std::string(name), *value, std::string(help))
      ->group(impl_->group)
      ->delimiter(',')
      ->take_all();
  return *this;
}

Flags& Flags::Add(std::string_view name, std::vector<std::string>* values, std::string_view help) {
  impl_->app->add_option("--" + std::string(name), *values, std::string(help))
      ->group(impl_->group)
      ->take_all();
  return *this;
}

Flags& Flags::Add(std::string_view name, uint64_t* value, std::string_view help) {
  AddOption(*impl_, name, value, help);
  return *this;
}

Flags& Flags::Add(std::string_view name, double* value, std::string_view help) {
  AddOption(*impl_, name, value, help);
  return *this;
}

Flags& Flags::Add(std::string_view name, bool* value, std::string_view help) {
  // expected(0, 1) lets COLMAP users write "--overwrite 1" as well as "--overwrite"; without a
  // value CLI11 takes default_str, so that the default for --help goes into option_text.
  impl_->app->add_option("--" + std::string(name), *value, std::string(help))
      ->group(impl_->group)
      ->expected(0, 1)
      ->take_last()
      ->default_str("1")
      ->option_text(*value ? "0|1 (default 1)" : "0|1 (default 0)");
  return *this;
}

Flags& Flags::AddChoice(std::string_view name,
                        std::string* value,
                        std::vector<std::string> choices,
                        std::string_view help) {
  impl_->app->add_option("--" + std::string(name), *value, std::string(help))
      ->group(impl_->group)
      ->capture_default_str()
      ->take_last()
      ->check(CLI::IsMember(std::move(choices)));
  return *this;
}

Flags& Flags::Positional(std::string_view name,
                         std::vector<std::filesystem::path>* values,
                         int min_num,
                         std::string_view help) {
  impl_->app->add_option(std::string(name), *values, std::string(help))
      ->group(impl_->group)
      ->expected(min_num, std::numeric_limits<int>::max())
      ->required();
  return *this;
}

Flags& Flags::ConfigFile(std::filesystem::path* value) {
  impl_->has_config = true;
  return Add("config", value, "File of flags, a line 'name = value' each; those given here win");
}

Flags& Flags::Require(std::string_view name, std::filesystem::path* value, std::string_view help) {
  impl_->app->add_option("--" + std::string(name), *value, std::string(help))
      ->group(impl_->group)
      ->take_last()
      ->required();
  return *this;
}

int RunProgram(const std::vector<Command>& commands, int argc, char** argv) {
  return Program(commands).Run(argc, argv);
}

}  // namespace vgtw
