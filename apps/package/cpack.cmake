# `cpack` makes five Debian packages: libverge-dev, verge-rsu, verge-obu, verge-common (what these
# two need) and verge-tools. There is no shared library to package: the planner is a static archive,
# so that a program that was tested plans the same for good.
set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_VENDOR verge)
set(CPACK_PACKAGE_CONTACT "verge maintainers <verge@example.org>")
set(CPACK_PACKAGE_DIRECTORY ${CMAKE_BINARY_DIR}/packages)
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_COMPONENTS_ALL dev common rsu obu tools)
set(CPACK_STRIP_FILES ON)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_DEBIAN_ENABLE_COMPONENT_DEPENDS OFF)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT) # name_version_architecture.deb
set(CPACK_DEBIAN_PACKAGE_RELEASE 1)
set(CPACK_DEBIAN_PACKAGE_CONTROL_STRICT_PERMISSION ON)
set(CPACK_INSTALL_DEFAULT_DIRECTORY_PERMISSIONS
    OWNER_READ OWNER_WRITE OWNER_EXECUTE GROUP_READ GROUP_EXECUTE WORLD_READ WORLD_EXECUTE)

set(CPACK_DEBIAN_DEV_PACKAGE_NAME libverge-dev)
set(CPACK_DEBIAN_DEV_PACKAGE_SECTION libdevel)
set(CPACK_DEBIAN_DEV_PACKAGE_DEPENDS "${VERGE_DEB_DEV_DEPENDS}")
set(CPACK_COMPONENT_DEV_DESCRIPTION "Joint planning of vehicles at the roadside: the library
The planner (static, without dependencies at run time), its messages and
buses, headers, and files for pkg-config and CMake.")

set(CPACK_DEBIAN_COMMON_PACKAGE_NAME verge-common)
set(CPACK_DEBIAN_COMMON_PACKAGE_SECTION net)
set(CPACK_DEBIAN_COMMON_PACKAGE_SHLIBDEPS ON)
set(CPACK_COMPONENT_COMMON_DESCRIPTION "Joint planning of vehicles at the roadside: operators
What asks a running daemon, the manual for operators, and the schemas of the
configurations; for verge-rsu and verge-obu.")

# The scripts of a daemon's package.
function(verge_scripts variable package)
    list(APPEND scripts conffiles postinst prerm postrm)
    list(TRANSFORM scripts PREPEND ${CMAKE_BINARY_DIR}/package/${package}/)
    set(${variable} ${scripts} PARENT_SCOPE)
endfunction()
set(VERGE_DEB_DAEMON_DEPENDS
    "adduser, verge-common (= ${PROJECT_VERSION}-${CPACK_DEBIAN_PACKAGE_RELEASE})")

set(CPACK_DEBIAN_OBU_PACKAGE_NAME verge-obu)
set(CPACK_DEBIAN_OBU_PACKAGE_SECTION net)
set(CPACK_DEBIAN_OBU_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_OBU_PACKAGE_DEPENDS "${VERGE_DEB_DAEMON_DEPENDS}")
set(CPACK_DEBIAN_OBU_PACKAGE_SUGGESTS verge-tools)
verge_scripts(CPACK_DEBIAN_OBU_PACKAGE_CONTROL_EXTRA verge-obu)
set(CPACK_COMPONENT_OBU_DESCRIPTION "Joint planning of vehicles at the roadside: on-vehicle unit
Follows the plans of a roadside unit while they are fresh and safe, plans for
its vehicle itself otherwise; with its systemd units and manual.")

set(CPACK_DEBIAN_RSU_PACKAGE_NAME verge-rsu)
set(CPACK_DEBIAN_RSU_PACKAGE_SECTION net)
set(CPACK_DEBIAN_RSU_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_RSU_PACKAGE_DEPENDS "${VERGE_DEB_DAEMON_DEPENDS}")
set(CPACK_DEBIAN_RSU_PACKAGE_SUGGESTS verge-tools)
verge_scripts(CPACK_DEBIAN_RSU_PACKAGE_CONTROL_EXTRA verge-rsu)
set(CPACK_COMPONENT_RSU_DESCRIPTION "Joint planning of vehicles at the roadside: the daemon
Hears the states of vehicles over LCM or DDS, decides for them jointly, plans
their trajectories and broadcasts the plans; with its systemd units and manual.")

set(CPACK_DEBIAN_TOOLS_PACKAGE_NAME verge-tools)
set(CPACK_DEBIAN_TOOLS_PACKAGE_SECTION science)
set(CPACK_DEBIAN_TOOLS_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_TOOLS_PACKAGE_DEPENDS "python3, python3-numpy, python3-matplotlib")
set(CPACK_COMPONENT_TOOLS_DESCRIPTION "Joint planning of vehicles at the roadside: tools
Plans and simulates scenarios, stands in for vehicles on a bus, repeats
recordings, draws and replays runs, measures; with the scenarios of the paper it comes from.")
include(CPack)
