/// See table.h.
#include "table.h"

#include "common/number.h"
#include "must.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static table_cell* cell_add(table* self, const char* key);
static bool        same_keys(const table_line* a, const table_line* b);
static void        markdown_head(FILE* out, const table_line* line);
static void        markdown_cell(FILE* out, const table_cell* cell);

void table_row(table* self)
{
    if (self->row_count == self->row_capacity) {
        self->row_capacity = 2 * self->row_capacity + 16;
        self->rows = must_realloc(self->rows, self->row_capacity * sizeof *self->rows);
    }
    self->rows[self->row_count++].cell_count = 0;
}

void table_text(table* self, const char* key, const char* text)
{
    table_cell* cell = cell_add(self, key);
    cell->is_text = true;
    snprintf(cell->text, sizeof cell->text, "%s", text);
}

void table_number(table* self, const char* key, double number)
{
    cell_add(self, key)->number = number;
}

void table_free(table* self)
{
    free(self->rows);
    *self = (table){ .experiment = self->experiment };
}

void table_write_json(FILE* out, const table* self)
{
    fputs("{\"experiment\": ", out);
    string_write(out, self->experiment);
    fputs(", \"rows\": [", out);
    for (uint32_t i = 0; i < self->row_count; ++i) {
        fprintf(out, "%s\n  {", i > 0 ? "," : "");
        for (uint32_t k = 0; k < self->rows[i].cell_count; ++k) {
            const table_cell* cell = &self->rows[i].cells[k];
            fputs(k > 0 ? ", " : "", out);
            string_write(out, cell->key);
            fputs(": ", out);
            if (cell->is_text) {
                string_write(out, cell->text);
            } else {
                number_write(out, cell->number);
            }
        }
        fputc('}', out);
    }
    fputs("]}\n", out);
}

void table_write_markdown(FILE* out, const table* self)
{
    for (uint32_t i = 0; i < self->row_count; ++i) {
        const table_line* line = &self->rows[i];
        if (i == 0 || !same_keys(line, line - 1)) {
            markdown_head(out, line);
        }
        fputc('|', out);
        for (uint32_t k = 0; k < line->cell_count; ++k) {
            markdown_cell(out, &line->cells[k]);
        }
        fputc('\n', out);
    }
}

static table_cell* cell_add(table* self, const char* key)
{
    table_line* line = &self->rows[self->row_count - 1];
    if (line->cell_count == TABLE_CELLS_MAX) {
        fputs("verge-experiment:table: more cells than a row can have\n", stderr);
        exit(1);
    }
    table_cell* cell = &line->cells[line->cell_count++];
    *cell = (table_cell){ .key = key };
    return cell;
}

static bool same_keys(const table_line* a, const table_line* b)
{
    bool same = a->cell_count == b->cell_count;
    for (uint32_t k = 0; same && k < a->cell_count; ++k) {
        same = strcmp(a->cells[k].key, b->cells[k].key) == 0;
    }
    return same;
}

static void markdown_head(FILE* out, const table_line* line)
{
    fputs("\n|", out);
    for (uint32_t k = 0; k < line->cell_count; ++k) {
        for (const char* c = line->cells[k].key; *c != '\0'; ++c) {
            fputc(*c == '_' ? ' ' : *c, out); // so that columns may wrap
        }
        fputc('|', out);
    }
    fputs("\n|", out);
    for (uint32_t k = 0; k < line->cell_count; ++k) {
        fputs(line->cells[k].is_text ? "---|" : "---:|", out);
    }
    fputc('\n', out);
}

/// Prints whole numbers unchanged and other values with at most three decimals.
static void markdown_cell(FILE* out, const table_cell* cell)
{
    if (cell->is_text) {
        fprintf(out, "%s|", cell->text);
    } else if (!isfinite(cell->number)) {
        fputs("–|", out);
    } else if (cell->number == round(cell->number) && fabs(cell->number) < 1e9) {
        fprintf(out, "%.0f|", cell->number);
    } else {
        fprintf(out, fabs(cell->number) < 10.0 ? "%.3f|" : "%.1f|", cell->number);
    }
}
