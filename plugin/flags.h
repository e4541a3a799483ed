// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

namespace vgtw {

// The flags of one command. Each Add binds a variable whose present value is the default shown by
// --help. Booleans are switches ("--overwrite") and also take a value ("--overwrite 0").
class Flags {
 public:
  // Heading in --help for the flags that follow: "Input", "Algorithm", "Output", "Usability".
  Flags& Group(std::string name);

  Flags& Add(std::string_view name, std::string* value, std::string_view help);
  Flags& Add(std::string_view name, std::filesystem::path* value, std::string_view help);
  Flags& Add(std::string_view name, int* value, std::string_view help);
  // "1,2,3"
  Flags& Add(std::string_view name, std::vector<int64_t>* value, std::string_view help);
  // May be given several times.
  Flags& Add(std::string_view name, std::vector<std::string>* values, std::string_view help);
  Flags& Add(std::string_view name, uint64_t* value, std::string_view help);
  Flags& Add(std::string_view name, double* value, std::string_view help);
  Flags& Add(std::string_view name, bool* value, std::string_view help);
  // One of `choices`.
  Flags& AddChoice(std::string_view name,
                   std::string* value,
                   std::vector<std::string> choices,
                   std::string_view help);
  // Paths without a flag's name, at least `min_num`.
  Flags& Positional(std::string_view name,
                    std::vector<std::filesystem::path>* values,
                    int min_num,
                    std::string_view help);
  // --config: a file with a line `name = value` per flag. The command line wins.
  Flags& ConfigFile(std::filesystem::path* value);
  // A path that must be given.
  Flags& Require(std::string_view name, std::filesystem::path* value, std::string_view help);

  struct Impl;
  explicit Flags(Impl* impl) : impl_(impl) {}

 private:
  Impl* impl_;
};

// Declares its flags and returns the work to do once they are parsed.
using DeclareCommand = std::function<std::function<void()>(Flags&)>;

// Runs a command with the whole command line, of which nothing was parsed.
using ForwardCommand = std::function<void(int argc, char** argv)>;

// One row of the table of commands. A name of two words ("mask make") is a sub-command; a row
// "mask" that neither declares nor forwards tells what they have in common, and comes first.
struct Command {
  std::string_view name;
  std::string_view summary;
  DeclareCommand declare = {};
  std::string_view examples = {};  // shown under --help, one per line
  ForwardCommand forward = {};     // in place of `declare`: another program has this command
};

// Parses the command line and runs the command: 0 done, 1 failed (one line on stderr), 2 wrong
// usage (with the nearest names for an unknown command or flag).
int RunProgram(const std::vector<Command>& commands, int argc, char** argv);

}  // namespace vgtw
