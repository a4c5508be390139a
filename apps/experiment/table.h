/// Rows of an experiment, written as JSON and as Markdown.
///
///     table rows = { .experiment = "freeway-table" };
///     table_row(&rows);
///     table_text(&rows, "method", "verge");
///     table_number(&rows, "finish_time", 5.25);
///     table_write_json(out, &rows);
///     table_free(&rows);
///
/// JSON       {"experiment": NAME, "rows": [{KEY: VALUE, ..}, ..]}; a number that is not finite
///            is null.
/// Markdown   one table for each run of rows with the same keys.
/// Memory     Heap, until table_free(). Keys are stored as pointers, so they must be literals. The
///            program ends if memory runs out.
#ifndef VERGE_EXPERIMENT_TABLE_H
#define VERGE_EXPERIMENT_TABLE_H

#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>

enum { TABLE_CELLS_MAX = 32, TABLE_TEXT_MAX = 96 };

typedef struct table_cell {
    const char* key;
    bool        is_text;
    double      number;
    char        text[TABLE_TEXT_MAX]; ///< longer ones are cut
} table_cell;

typedef struct table_line {
    uint32_t   cell_count;
    table_cell cells[TABLE_CELLS_MAX];
} table_line;

typedef struct table {
    const char* experiment;
    uint32_t    row_count, row_capacity;
    table_line* rows;
} table;

void table_row(table* self); ///< starts a row; the cells below go into it
void table_text(table* self, const char* key, const char* text);
void table_number(table* self, const char* key, double number);
void table_free(table* self);

void table_write_json(FILE* out, const table* self);
void table_write_markdown(FILE* out, const table* self);

#endif
