// SPDX-License-Identifier: BSD-3-Clause
#include "scene/error.h"

#include <cerrno>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace vgtw {
namespace {

using testing::StrEq;
using testing::ThrowsMessage;

TEST(Fail, TellsFoundExpectedAndHint) {
  EXPECT_THAT([] { Fail("a/b.txt", "is empty", "a line", "write one"); },
              ThrowsMessage<Error>(StrEq("a/b.txt: is empty, expected a line; write one")));
  EXPECT_THAT([] { Fail("a\nb", "is empty", "a line"); },
              ThrowsMessage<Error>(StrEq("a?b: is empty, expected a line")));
}

TEST(FailErrno, TellsTheSystemsReason) {
  EXPECT_THAT(
      [] {
        errno = ENOSPC;
        FailErrno("a.txt", "cannot be written");
      },
      ThrowsMessage<Error>(StrEq("a.txt: cannot be written: No space left on device")));
}

TEST(Check, ThrowsConditionAndMessage) {
  const int value = -1;
  EXPECT_THAT([&] { VGTW_CHECK(value > 0, "value " + std::to_string(value)); },
              ThrowsMessage<std::invalid_argument>(StrEq("value > 0 violated: value -1")));
  EXPECT_NO_THROW(VGTW_CHECK(value < 0, "value"));
}

TEST(Error, IsOneLineWhateverItQuotes) {
  EXPECT_STREQ(Error("a\nb\x1b[0m\xff").what(), "a?b?[0m?");
  EXPECT_STREQ(Error(std::string(5000, 'a')).what(), std::string(5000, 'a').c_str());
}

TEST(Printable, KeepsTextOfAnyLanguage) {
  const std::string text = "a \xc3\xa4 \xe2\x82\xac \xf0\x9f\x98\x80 ~";
  EXPECT_EQ(Printable(text), text);
  EXPECT_EQ(Printable(""), "");
}

TEST(Printable, ReplacesControlCharactersAndInvalidBytes) {
  EXPECT_EQ(Printable(std::string_view("a\0\n\x1b[31m\x7f", 9)), "a???[31m?");
  EXPECT_EQ(Printable("\xe4"), "?");                 // Latin-1, cut short as UTF-8
  EXPECT_EQ(Printable("\xc0\xaf"), "??");            // overlong '/'
  EXPECT_EQ(Printable("\xed\xa0\x80"), "???");       // surrogate
  EXPECT_EQ(Printable("\xf4\x90\x80\x80"), "????");  // beyond U+10FFFF
  EXPECT_EQ(Printable("\xff\x80"), "??");
}

TEST(Printable, CutsBetweenCharacters) {
  EXPECT_EQ(Printable(std::string(200, 'a')), std::string(200, 'a'));
  EXPECT_EQ(Printable(std::string(201, 'a')), std::string(200, 'a') + "...");
  EXPECT_EQ(Printable(std::string(199, 'a') + "\xc3\xa4"
                                              "b"),
            std::string(199, 'a') + "\xc3\xa4...");
}

}  // namespace
}  // namespace vgtw
