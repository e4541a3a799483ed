# Toolchain of the preset "asan": the clang that scripts/install_packages installs.
find_program(CMAKE_CXX_COMPILER NAMES clang++-14 clang++-19 REQUIRED)
