// Small dense blocks of the nodes that separate stretches of a grid, and how two stretches become one.
#pragma once

#include <array>

namespace stickslip {

template <int hw>
struct Block {
  double m[hw][hw];
};

// Of nodes whose inside is eliminated (static condensation): their part of the matrix of the separators at
// its ends, left and right.
template <int hw>
struct CondensedMatrix {
  Block<hw> LL, LR, RR;
};
// Its part of the right-hand side, and the right-hand side of the separator behind it.
template <int hw>
struct CondensedLoad {
  double L[hw], R[hw], behind[hw];
};

// The separator between two such, eliminated.
template <int hw>
struct Separator {
  Block<hw> inverse, from_left, from_right;  // S^-1; couplings of the ends with it, times S^-1

  // `d`: its diagonal, c[k]: beside it. False where a pivot is not positive.
  bool eliminate(const double* d, const double* c, const CondensedMatrix<hw>& left,
                 const CondensedMatrix<hw>& right, CondensedMatrix<hw>& both) {
    Block<hw> S;
    for (int i = 0; i < hw; ++i)
      for (int j = 0; j < hw; ++j)
        S.m[i][j] = (i == j ? d[i] : c[i < j ? j - i : i - j]) + (left.RR.m[i][j] + right.LL.m[i][j]);
    const bool positive = invert(S);
    for (int i = 0; i < hw; ++i)
      for (int j = 0; j < hw; ++j) {
        double of_left = 0, of_right = 0;
        for (int k = 0; k < hw; ++k) {
          of_left += left.LR.m[i][k] * inverse.m[k][j];
          of_right += right.LR.m[k][i] * inverse.m[k][j];
        }
        from_left.m[i][j] = of_left;
        from_right.m[i][j] = of_right;
      }
    for (int i = 0; i < hw; ++i)
      for (int j = 0; j < hw; ++j) {
        double ll = left.LL.m[i][j], rr = right.RR.m[i][j], lr = 0;
        for (int k = 0; k < hw; ++k) {
          ll -= from_left.m[i][k] * left.LR.m[j][k];
          rr -= from_right.m[i][k] * right.LR.m[k][j];
          lr -= from_left.m[i][k] * right.LR.m[k][j];
        }
        both.LL.m[i][j] = ll;
        both.RR.m[i][j] = rr;
        both.LR.m[i][j] = lr;
      }
    return positive;
  }

  // b: the separator's own right-hand side, which becomes that after elimination of both insides.
  void join(const CondensedLoad<hw>& left, const CondensedLoad<hw>& right, double* b,
            CondensedLoad<hw>& both) const {
    for (int i = 0; i < hw; ++i) b[i] = left.behind[i] + (left.R[i] + right.L[i]);
    for (int i = 0; i < hw; ++i) {
      double l = left.L[i], r = right.R[i];
      for (int k = 0; k < hw; ++k) {
        l -= from_left.m[i][k] * b[k];
        r -= from_right.m[i][k] * b[k];
      }
      both.L[i] = l;
      both.R[i] = r;
      both.behind[i] = right.behind[i];
    }
  }

  // x of the separator from those of the ends.
  void solve(const double* b, const double* x_left, const double* x_right, double* x) const {
    for (int i = 0; i < hw; ++i) {
      double sum = 0;
      for (int k = 0; k < hw; ++k)
        sum += inverse.m[i][k] * b[k] - from_left.m[k][i] * x_left[k] - from_right.m[k][i] * x_right[k];
      x[i] = sum;
    }
  }

 private:
  // inverse = S^-1 by elimination without exchange.
  bool invert(Block<hw>& S) {
    bool positive = true;
    for (int i = 0; i < hw; ++i)
      for (int j = 0; j < hw; ++j) inverse.m[i][j] = i == j;
    for (int k = 0; k < hw; ++k) {
      positive = positive && S.m[k][k] > 0;
      const double over = 1 / S.m[k][k];
      for (int j = 0; j < hw; ++j) {
        S.m[k][j] *= over;
        inverse.m[k][j] *= over;
      }
      for (int i = 0; i < hw; ++i) {
        if (i == k) continue;
        const double factor = S.m[i][k];
        for (int j = 0; j < hw; ++j) {
          S.m[i][j] -= factor * S.m[k][j];
          inverse.m[i][j] -= factor * inverse.m[k][j];
        }
      }
    }
    return positive;
  }
};

// Eight stretches side by side become one: the separator behind stretch i (i < 7) goes in the round in which
// the lowest zero of i in binary is met.
constexpr std::array<int, 7> order_of_eight = {0, 2, 4, 6, 1, 5, 3};

}  // namespace stickslip
