#!/usr/bin/python3
"""check_sizes.py finds functions, and counts their lines."""
import sys
import unittest

sys.dont_write_bytecode = True
import check_sizes

SOURCE = '''#include <x.h>
#define BRACE {
namespace a {
namespace {
struct S {
  int member() const {
    return '{';  // }
  }
  int x = f({1, 2});
};
constexpr int kTable[] = {1, 2};
template <typename T>
T free(const T& t = {},
       int count = 1'000) {
  if (t) {
    return [] { return "}"; }();
  }
  return t;
}
}  // namespace
S::S(int y) : a_{1}, b_(2) {
  y = 1;
}
}  // namespace a
int main() {}
'''


class CheckSizes(unittest.TestCase):
    def test_finds_each_function_with_its_lines(self):
        self.assertEqual(check_sizes.functions_of(SOURCE),
                         [("member", 6, 3), ("free", 12, 8), ("S::S", 21, 3), ("main", 25, 1)])


if __name__ == "__main__":
    unittest.main()
