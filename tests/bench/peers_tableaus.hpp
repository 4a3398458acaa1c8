// Explicit pairs that newer releases of ARKODE default to or offer, as tables for SUNDIALS 6.4: Tsitouras
// 5(4) (Computers and Mathematics with Applications 62, 2011) and Verner's efficient 9(8) (Numerical
// Algorithms 53, 2010). Those of orders 6 to 8 are the library's own rk 6vr, 7vr, 8vr. bench_peers checks the
// conditions of order of all of them.
#pragma once

#include <petscts.h>

#include <cmath>
#include <complex>
#include <string>
#include <tuple>
#include <vector>

#include "stickslip/base/error.hpp"
#include "stickslip/base/vectors.hpp"

namespace peers {

struct Tableau {
  int stages, order, embedded_order;
  std::vector<double> A, b, embedded;  // A by rows
  std::vector<double> c() const {
    std::vector<double> sums;
    for (int i = 0; i < stages; ++i) {
      sums.push_back(0);
      for (int j = 0; j < i; ++j) sums.back() += A[std::size_t(i * stages + j)];
    }
    return sums;
  }
};

// Entries (row, column, value) of A, those beyond the last row being b and the embedded weights.
inline Tableau tableau_of(int stages, int order, const std::vector<std::tuple<int, int, double>>& entries) {
  const auto s = std::size_t(stages);
  Tableau t{
      stages, order, order - 1, std::vector<double>(s * s), std::vector<double>(s), std::vector<double>(s)};
  for (const auto& [row, column, value] : entries)
    (row < stages ? t.A[std::size_t(row) * s + std::size_t(column)]
                  : (row == stages ? t.b : t.embedded)[std::size_t(column)]) = value;
  return t;
}

inline Tableau tsitouras5() {
  return tableau_of(7, 5,
                    {{1, 0, 0.161},
                     {2, 0, -0.008480655492356988544},
                     {2, 1, 0.3354806554923569885},
                     {3, 0, 2.897153057105493432},
                     {3, 1, -6.359448489975074843},
                     {3, 2, 4.362295432869581411},
                     {4, 0, 5.325864828439256604},
                     {4, 1, -11.74888356406282788},
                     {4, 2, 7.495539342889836208},
                     {4, 3, -0.09249506636175524926},
                     {5, 0, 5.861455442946420029},
                     {5, 1, -12.92096931784710929},
                     {5, 2, 8.159367898576158643},
                     {5, 3, -0.07158497328140099723},
                     {5, 4, -0.02826905039406838291},
                     {6, 0, 0.09646076681806522952},
                     {6, 1, 0.01},
                     {6, 2, 0.4798896504144995748},
                     {6, 3, 1.379008574103741893},
                     {6, 4, -3.290069515436080680},
                     {6, 5, 2.324710524099773982},
                     {7, 0, 0.09646076681806522952},
                     {7, 1, 0.01},
                     {7, 2, 0.4798896504144995748},
                     {7, 3, 1.379008574103741893},
                     {7, 4, -3.290069515436080680},
                     {7, 5, 2.324710524099773982},
                     {8, 0, 0.09352374858189270664},
                     {8, 1, 0.008652883141566367610},
                     {8, 2, 0.4928930991314318682},
                     {8, 3, 1.140235412267858096},
                     {8, 4, -2.329180192439364559},
                     {8, 5, 1.568875049316615520},
                     {8, 6, 0.025}});
}

inline Tableau verner9() {
  return tableau_of(16, 9,
                    {{1, 0, 0.03462},
                     {2, 0, -0.0389335438857287327017},
                     {2, 1, 0.1359578945245091786500},
                     {3, 0, 0.03638413148954266723061},
                     {3, 2, 0.1091523944686280016918},
                     {4, 0, 2.025763914393969636806},
                     {4, 2, -7.638023836496292020388},
                     {4, 3, 6.173259922102322383582},
                     {5, 0, 0.05112275589406060872792},
                     {5, 3, 0.1770823794555021537930},
                     {5, 4, 0.00080277624092225014536139},
                     {6, 0, 0.1316006357975216279280},
                     {6, 3, -0.2957276252669636417685},
                     {6, 4, 0.0878137803564295237421},
                     {6, 5, 0.6213052975225274774321},
                     {7, 0, 0.07166666666666666666667},
                     {7, 5, 0.3305533578915319409260},
                     {7, 6, 0.2427799754418013924073},
                     {8, 0, 0.07180664062500000000000},
                     {8, 5, 0.3294380283228177160745},
                     {8, 6, 0.1165190029271822839255},
                     {8, 7, -0.03401367187500000000000},
                     {9, 0, 0.04836757646340646986611},
                     {9, 5, 0.03928989925676163974333},
                     {9, 6, 0.1054740945890344608264},
                     {9, 7, -0.02143865284648312665983},
                     {9, 8, -0.1041229174627194437760},
                     {10, 0, -0.02664561487201478635338},
                     {10, 5, 0.03333333333333333333333},
                     {10, 6, -0.1631072244872467239163},
                     {10, 7, 0.03396081684127761199488},
                     {10, 8, 0.1572319413814626097111},
                     {10, 9, 0.2152267478031879552304},
                     {11, 0, 0.03689009248708622334786},
                     {11, 5, -0.1465181576725542928654},
                     {11, 6, 0.2242577768172024345345},
                     {11, 7, 0.02294405717066072637091},
                     {11, 8, -0.0035850052905728761357},
                     {11, 9, 0.08669223316444385506869},
                     {11, 10, 0.4383840651968337846196},
                     {12, 0, -0.4866012215113340846662},
                     {12, 5, -6.304602650282852990658},
                     {12, 6, -0.281245618289472564778},
                     {12, 7, -2.679019236219849057688},
                     {12, 8, 0.518815663924157511565},
                     {12, 9, 1.365353187603341710684},
                     {12, 10, 5.885091088503946585721},
                     {12, 11, 2.802808786272062889820},
                     {13, 0, 0.4185367457753471441471},
                     {13, 5, 6.724547581906459363101},
                     {13, 6, -0.425444280164611790607},
                     {13, 7, 3.343279153001265577812},
                     {13, 8, 0.617081663117537759528},
                     {13, 9, -0.929966123939932833938},
                     {13, 10, -6.099948804751010722473},
                     {13, 11, -3.002206187889399044804},
                     {13, 12, 0.2553202529443445472337},
                     {14, 0, -0.779374086122884664645},
                     {14, 5, -13.93734253810777678787},
                     {14, 6, 1.252048853379357320950},
                     {14, 7, -14.69150040801686878192},
                     {14, 8, -0.494705058533141685655},
                     {14, 9, 2.242974909146236657907},
                     {14, 10, 13.36789380382864375814},
                     {14, 11, 14.39665048665068644512},
                     {14, 12, -0.7975813331776800379128},
                     {14, 13, 0.4409353709534277758754},
                     {15, 0, 2.058051337466886442151},
                     {15, 5, 22.35793772796803295519},
                     {15, 6, 0.90949810997556332745},
                     {15, 7, 35.89110098240264104711},
                     {15, 8, -3.442515027624453437985},
                     {15, 9, -4.865481358036368826566},
                     {15, 10, -18.90980381354342625688},
                     {15, 11, -34.26354448030451782929},
                     {15, 12, 1.264756521695642578828},
                     {16, 0, 0.01461197685842315252052},
                     {16, 7, -0.3915211862331339089410},
                     {16, 8, 0.2310932500289506415910},
                     {16, 9, 0.1274766769992852382561},
                     {16, 10, 0.2246434176204157731567},
                     {16, 11, 0.5684352689748512932705},
                     {16, 12, 0.05825871557215827200815},
                     {16, 13, 0.1364317403482215641609},
                     {16, 14, 0.03057013983082797397721},
                     {17, 0, 0.01996996514886773085519},
                     {17, 7, 2.191499304949330054531},
                     {17, 8, 0.08857071848208438030834},
                     {17, 9, 0.1140560234865965622485},
                     {17, 10, 0.2533163805345107065565},
                     {17, 11, -2.056564386240941011159},
                     {17, 12, 0.3408096799013119935161},
                     {17, 15, 0.04834231373823958314377}});
}

inline Tableau of_library(const char* rk, int order) {
  stickslip::TsHandle ts;
  SS_TRY(TSCreate(PETSC_COMM_SELF, ts.out()));
  SS_TRY(TSSetType(ts, TSRK));
  SS_TRY(TSRKSetType(ts, rk));
  PetscInt s, degree;
  const PetscReal *A, *b, *c, *embedded, *interpolating;
  PetscBool fsal;
  SS_TRY(TSRKGetTableau(ts, &s, &A, &b, &c, &embedded, &degree, &interpolating, &fsal));
  return {int(s), order, order - 1, {A, A + s * s}, {b, b + s}, {embedded, embedded + s}};
}

// The largest violation of the conditions of order that the trees without branches beside their root give:
// b A^j c^k = k!/(k + 1 + j)! for k + 1 + j <= order. (SUNDIALS itself checks all trees up to order 6.)
inline double violation(const Tableau& t, const std::vector<double>& weights, int order) {
  double worst = 0;
  const std::vector<double> c = t.c();
  const auto s = std::size_t(t.stages);
  for (int k = 0; k < order; ++k) {
    std::vector<double> v(s);
    double expected = 1;
    for (std::size_t i = 0; i < s; ++i) v[i] = std::pow(c[i], k);
    for (int j = 0; k + 1 + j <= order; ++j) {
      expected /= k + 1 + j;
      double sum = 0;
      for (std::size_t i = 0; i < s; ++i) sum += weights[i] * v[i];
      worst = std::max(worst, std::abs(sum - expected));
      std::vector<double> next(s);
      for (std::size_t i = 0; i < s; ++i)
        for (std::size_t l = 0; l < i; ++l) next[i] += t.A[i * s + l] * v[l];
      v = next;
    }
  }
  return worst;
}

// How far along the imaginary axis |R| stays below 1.001: what undamped waves allow a step, times their
// frequency.
inline double reach(const Tableau& t) {
  const auto s = std::size_t(t.stages);
  for (double y = 0.05;; y += 0.05) {
    const std::complex<double> z(0, y);
    std::complex<double> R = 1;
    std::vector<std::complex<double>> k(s);
    for (std::size_t i = 0; i < s; ++i) {
      k[i] = 1;
      for (std::size_t j = 0; j < i; ++j) k[i] += z * t.A[i * s + j] * k[j];
      R += z * t.b[i] * k[i];
    }
    if (std::abs(R) > 1.001) return y - 0.05;
  }
}

}  // namespace peers
