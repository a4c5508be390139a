/// The path of the data files that are installed with the programs: share/verge beside their bin,
/// in any install folder. The build folder has the same layout.
#ifndef VERGE_APPS_DATA_H
#define VERGE_APPS_DATA_H

enum { DATA_PATH_SIZE = 1024 };

/// "<folder of this program>/../share/verge/NAME". If the folder of the program is unknown, the
/// path starts in the current folder. The existence of the file is not checked.
const char* data_path(char path[DATA_PATH_SIZE], const char* name);

#endif
