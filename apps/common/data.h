/// Where the files lie that are installed beside the programs: share/verge next to their bin,
/// wherever the two were put. The build folder is laid out the same way.
#ifndef VERGE_APPS_DATA_H
#define VERGE_APPS_DATA_H

enum { DATA_PATH_SIZE = 1024 };

/// "<folder of this program>/../share/verge/NAME". Where the program's own place cannot be told,
/// the path starts in the current folder; whoever opens it says what is missing.
const char* data_path(char path[DATA_PATH_SIZE], const char* name);

#endif
