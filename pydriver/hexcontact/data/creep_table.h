/* Read a creep table of `hexcontact study`: loads on body 1 by creepages and spin, in the steady state of rolling.
 *
 *     creep_table table;
 *     double loads[3];                          // along x and y [N], torque [N m]
 *     if (creep_table_read(&table, "creep.txt") != 0) exit(1);
 *     creep_table_loads(&table, -0.001, 0.0005, 0.2, loads);
 *     creep_table_free(&table);
 *
 * The same as creep_table.py of hexcontact, whose comments explain axes, pole and interpolation. C99; nothing else is needed.
 */
#ifndef CREEP_TABLE_H
#define CREEP_TABLE_H

#include <stdio.h>
#include <stdlib.h>

typedef struct {
  int count[3];
  double pole[2], limit;
  double *axis[3], *loads;
} creep_table;

static inline void creep_table_free(creep_table *table) {
  for (int d = 0; d < 3; d++) free(table->axis[d]);
  free(table->loads);
}

/* Return 0, or 1 if the file cannot be read. */
static inline int creep_table_read(creep_table *table, const char *path) {
  FILE *file = fopen(path, "r");
  int c, good;
  if (!file) return 1;
  while ((c = fgetc(file)) == '#')
    while (c != '\n' && c != EOF) c = fgetc(file);
  ungetc(c, file);
  for (int d = 0; d < 3; d++) table->axis[d] = NULL;
  table->loads = NULL;
  good = fscanf(file, "%d%d%d", &table->count[0], &table->count[1], &table->count[2]) == 3;
  good = good && fscanf(file, "%lf%lf%lf", &table->pole[0], &table->pole[1], &table->limit) == 3;
  size_t size = 3;
  for (int d = 0; d < 3 && good; d++) {
    size *= (size_t)table->count[d];
    table->axis[d] = malloc((size_t)table->count[d] * sizeof(double));
    good = table->axis[d] != NULL;
    for (int i = 0; i < table->count[d] && good; i++) good = fscanf(file, "%lf", &table->axis[d][i]) == 1;
  }
  if (good) table->loads = malloc(size * sizeof(double));
  good = good && table->loads;
  for (size_t i = 0; i < size && good; i++) good = fscanf(file, "%lf", &table->loads[i]) == 1;
  fclose(file);
  if (!good) creep_table_free(table);
  return !good;
}

/* Weights of four values from the returned index on. */
static inline int creep_table_weights(const double *axis, int count, double at, double weight[4]) {
  int left = 0, first, j;
  for (int m = 0; m < 4; m++) weight[m] = 0.0;
  while (left < count - 2 && at >= axis[left + 1]) left++;
  first = left - 1 < 0 ? 0 : left - 1 > count - 4 ? count - 4 : left - 1;
  j = left - first;
  const double *x = axis + first;
  double h = x[j + 1] - x[j], t = (at - x[j]) / h;
  double slope[2] = {h * t * (1.0 - t) * (1.0 - t), h * t * t * (t - 1.0)};
  weight[j] = (1.0 + 2.0 * t) * (1.0 - t) * (1.0 - t);
  weight[j + 1] = (3.0 - 2.0 * t) * t * t;
  for (int k = j; k <= j + 1; k++) {
    int low = k < 2 ? 0 : 1;
    for (int m = 0; m < 3; m++) {
      double here = x[low + m], p = x[low + (m + 1) % 3], q = x[low + (m + 2) % 3];
      weight[low + m] += slope[k - j] * (2.0 * x[k] - p - q) / ((here - p) * (here - q));
    }
  }
  return first;
}

/* Loads along x and y [N] and torque [N m] on body 1. */
static inline void creep_table_loads(const creep_table *table, double creepage_x, double creepage_y, double spin, double loads[3]) {
  double at[3] = {creepage_x - spin * table->pole[1], creepage_y + spin * table->pole[0], spin};
  double sign_x = 1.0, sign = 1.0, over = 1.0, weight[3][4];
  int first[3];
  if (table->axis[2][0] == 0.0 && at[2] < 0.0) sign = -1.0, at[1] = -at[1], at[2] = -at[2];
  if (table->axis[0][0] == 0.0 && at[0] < 0.0) sign_x = -1.0, at[0] = -at[0];
  for (int d = 0; d < 3; d++) {
    double end = table->axis[d][at[d] > 0.0 ? table->count[d] - 1 : 0];
    if (end != 0.0 && at[d] / end > over) over = at[d] / end;
  }
  for (int d = 0; d < 3; d++) first[d] = creep_table_weights(table->axis[d], table->count[d], at[d] / over, weight[d]);
  loads[0] = loads[1] = loads[2] = 0.0;
  for (int k = 0; k < 4; k++)
    for (int j = 0; j < 4; j++)
      for (int i = 0; i < 4; i++) {
        size_t row = ((size_t)(first[2] + k) * table->count[1] + first[1] + j) * table->count[0] + first[0] + i;
        for (int m = 0; m < 3; m++) loads[m] += weight[2][k] * weight[1][j] * weight[0][i] * table->loads[3 * row + m];
      }
  loads[0] *= sign_x;
  loads[1] *= sign;
  loads[2] *= sign;
}

#endif
