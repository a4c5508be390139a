# What `cmake --install` puts where, by component: dev (library), rsu and obu (daemons), common
# (what both daemons need), tools (the rest).
# Every path follows the prefix given at install time, so one build serves any of them.
include(GNUInstallDirs)
include(CMakePackageConfigHelpers)

set(VERGE_CMAKE_DIR ${CMAKE_INSTALL_LIBDIR}/cmake/verge)
set(VERGE_PACKAGE_DIR ${CMAKE_CURRENT_LIST_DIR})

# --- the library: find_package(verge), pkg-config verge ---------------------------------------
set_target_properties(verge_core PROPERTIES EXPORT_NAME core)
install(TARGETS verge_core EXPORT verge
    ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT dev)
install(DIRECTORY core/include/verge DESTINATION ${CMAKE_INSTALL_INCLUDEDIR} COMPONENT dev)
if(VERGE_CONFIG_HEADER)
    install(FILES ${CMAKE_BINARY_DIR}/core/include/verge/user_config.h
        DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/verge COMPONENT dev)
    set(VERGE_PC_CONFIG " -DVERGE_USER_CONFIG='<verge/user_config.h>'")
endif()
set(VERGE_PC_FILES verge.pc)
if(TARGET verge_transport)
    set_target_properties(verge_transport PROPERTIES EXPORT_NAME transport)
    install(TARGETS verge_transport EXPORT verge
        ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT dev)
    # transport.h names the generated message types beside itself.
    install(DIRECTORY transport/include/verge DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}
        COMPONENT dev)
    get_target_property(headers verge_transport VERGE_TYPE_HEADERS)
    install(FILES ${headers} DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/verge COMPONENT dev)
    install(DIRECTORY transport/types DESTINATION ${CMAKE_INSTALL_DATADIR}/verge COMPONENT dev)
    list(APPEND VERGE_PC_FILES verge-transport.pc)
    if(VERGE_OPENSSL)
        string(APPEND VERGE_PC_TRANSPORT_LIBS " -lcrypto")
    endif()
    if(VERGE_DDS)
        string(APPEND VERGE_PC_TRANSPORT_LIBS " -lddsc")
    endif()
endif()

install(EXPORT verge NAMESPACE verge:: FILE vergeTargets.cmake DESTINATION ${VERGE_CMAKE_DIR}
    COMPONENT dev)
configure_package_config_file(${VERGE_PACKAGE_DIR}/vergeConfig.cmake.in
    ${CMAKE_BINARY_DIR}/package/vergeConfig.cmake INSTALL_DESTINATION ${VERGE_CMAKE_DIR}
    NO_SET_AND_CHECK_MACRO NO_CHECK_REQUIRED_COMPONENTS_MACRO)
# Before 1.0 a minor version may change the interface.
write_basic_package_version_file(${CMAKE_BINARY_DIR}/package/vergeConfigVersion.cmake
    COMPATIBILITY SameMinorVersion)
install(FILES ${CMAKE_BINARY_DIR}/package/vergeConfig.cmake
    ${CMAKE_BINARY_DIR}/package/vergeConfigVersion.cmake
    DESTINATION ${VERGE_CMAKE_DIR} COMPONENT dev)

file(RELATIVE_PATH VERGE_PC_PREFIX /prefix/${CMAKE_INSTALL_LIBDIR}/pkgconfig /prefix)
string(REGEX REPLACE "/$" "" VERGE_PC_PREFIX ${VERGE_PC_PREFIX})
foreach(file ${VERGE_PC_FILES})
    configure_file(${VERGE_PACKAGE_DIR}/${file}.in ${CMAKE_BINARY_DIR}/package/${file} @ONLY)
    install(FILES ${CMAKE_BINARY_DIR}/package/${file}
        DESTINATION ${CMAKE_INSTALL_LIBDIR}/pkgconfig COMPONENT dev)
endforeach()

if(NOT VERGE_BUILD_APPS)
    return()
endif()

# --- the programs and their data ---------------------------------------------------------------
set(VERGE_PROGRAMS_common verge-ctl)
set(VERGE_PROGRAMS_rsu verge-rsu)
set(VERGE_PROGRAMS_obu verge-obu)
set(VERGE_PROGRAMS_tools verge-plan verge-sim verge-publish verge-echo verge-replay verge-bench
    verge-experiment)
set(VERGE_PAGES_common verge.7)
set(VERGE_PAGES_rsu verge-rsu.json.5)
set(VERGE_PAGES_obu verge-obu.json.5)
# Programs in Python: links to their files, which lie in a folder of their own.
set(VERGE_SCRIPTS_tools verge-plot verge-replay-html)
set(VERGE_PAGES_tools verge-scenario.5)
foreach(component common rsu obu tools)
    install(TARGETS ${VERGE_PROGRAMS_${component}} RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR}
        COMPONENT ${component})
    foreach(program ${VERGE_PROGRAMS_${component}} ${VERGE_SCRIPTS_${component}})
        install(FILES apps/completion/verge.bash RENAME ${program}
            DESTINATION ${CMAKE_INSTALL_DATADIR}/bash-completion/completions
            COMPONENT ${component})
        file(GLOB page RELATIVE ${PROJECT_SOURCE_DIR}/apps/man apps/man/${program}.[18])
        list(APPEND VERGE_PAGES_${component} ${page})
    endforeach()
    # Without a name and an instant inside (gzip -n), the same page makes the same bytes.
    foreach(page ${VERGE_PAGES_${component}})
        string(REGEX MATCH "[0-9]$" section ${page})
        add_custom_command(OUTPUT ${CMAKE_BINARY_DIR}/man/${page}.gz
            COMMAND sh -c "gzip -9n <\"$1\" >\"$2\"" gzip
                ${PROJECT_SOURCE_DIR}/apps/man/${page} ${CMAKE_BINARY_DIR}/man/${page}.gz
            DEPENDS apps/man/${page} VERBATIM)
        list(APPEND VERGE_GZIPPED_PAGES ${CMAKE_BINARY_DIR}/man/${page}.gz)
        install(FILES ${CMAKE_BINARY_DIR}/man/${page}.gz
            DESTINATION ${CMAKE_INSTALL_MANDIR}/man${section} COMPONENT ${component})
    endforeach()
endforeach()
# name of the program:name of its file, in tools/
set(VERGE_TOOLS_DIR ${CMAKE_INSTALL_DATADIR}/verge/tools)
file(RELATIVE_PATH VERGE_TOOLS_FROM_BIN /prefix/${CMAKE_INSTALL_BINDIR} /prefix/${VERGE_TOOLS_DIR})
file(MAKE_DIRECTORY ${CMAKE_BINARY_DIR}/bin ${CMAKE_BINARY_DIR}/package)
foreach(pair verge-plot:plot.py verge-replay-html:replay_html.py)
    string(REPLACE ":" ";" pair ${pair})
    list(GET pair 0 program)
    list(GET pair 1 file)
    file(CREATE_LINK ${PROJECT_SOURCE_DIR}/tools/${file} ${CMAKE_BINARY_DIR}/bin/${program} SYMBOLIC)
    file(CREATE_LINK ${VERGE_TOOLS_FROM_BIN}/${file} ${CMAKE_BINARY_DIR}/package/${program} SYMBOLIC)
    install(FILES ${CMAKE_BINARY_DIR}/package/${program} DESTINATION ${CMAKE_INSTALL_BINDIR}
        COMPONENT tools)
    install(PROGRAMS tools/${file} DESTINATION ${VERGE_TOOLS_DIR} COMPONENT tools)
endforeach()
file(WRITE ${CMAKE_BINARY_DIR}/package/version "${PROJECT_VERSION}\n")
install(FILES tools/one_line.py tools/road_lines.py tools/run_file.py
    ${CMAKE_BINARY_DIR}/package/version DESTINATION ${VERGE_TOOLS_DIR} COMPONENT tools)
install(DIRECTORY tools/replay_page DESTINATION ${VERGE_TOOLS_DIR} COMPONENT tools)
file(MAKE_DIRECTORY ${CMAKE_BINARY_DIR}/man)
add_custom_target(verge-man ALL DEPENDS ${VERGE_GZIPPED_PAGES})
install(DIRECTORY apps/schema DESTINATION ${CMAKE_INSTALL_DATADIR}/verge COMPONENT common)
install(DIRECTORY apps/scenarios DESTINATION ${CMAKE_INSTALL_DATADIR}/verge COMPONENT tools
    FILES_MATCHING PATTERN *.json)

# verge_daemon(COMPONENT OTHER ACCOUNT WATCHDOG_S ABOUT): systemd units, configuration, examples and
# the scripts of the package of verge-COMPONENT. The account is also its folder in /etc, /run and
# /var/lib.
function(verge_daemon COMPONENT OTHER ACCOUNT WATCHDOG_S ABOUT)
    set(DAEMON verge-${COMPONENT})
    set(CONFIG ${COMPONENT}.json)
    set(made ${CMAKE_BINARY_DIR}/package/${DAEMON})
    configure_file(${VERGE_PACKAGE_DIR}/system.cmake.in ${made}/system.cmake @ONLY)
    foreach(script conffiles postinst prerm postrm)
        configure_file(${VERGE_PACKAGE_DIR}/daemon/${script}.in ${made}/${script} @ONLY)
    endforeach()
    install(SCRIPT ${made}/system.cmake COMPONENT ${COMPONENT})
    install(DIRECTORY apps/site/ DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/${DAEMON}/examples
        COMPONENT ${COMPONENT} PATTERN ${OTHER}* EXCLUDE)
endfunction()
verge_daemon(rsu obu verge 10 "roadside planner")
verge_daemon(obu rsu verge-obu 3 "on-vehicle unit")
install(PROGRAMS tools/certs DESTINATION ${CMAKE_INSTALL_DOCDIR}-rsu/examples COMPONENT rsu)

# Debian wants to know under what terms; each package says so itself.
foreach(pair dev:libverge-dev common:verge-common rsu:verge-rsu obu:verge-obu tools:verge-tools)
    string(REPLACE ":" ";" pair ${pair})
    list(GET pair 0 component)
    list(GET pair 1 package)
    install(FILES ${VERGE_PACKAGE_DIR}/copyright
        DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/${package} COMPONENT ${component})
endforeach()

set(VERGE_DEB_DEV_DEPENDS "liblcm-dev")
if(VERGE_OPENSSL)
    string(APPEND VERGE_DEB_DEV_DEPENDS ", libssl-dev")
endif()
if(VERGE_DDS)
    string(APPEND VERGE_DEB_DEV_DEPENDS ", cyclonedds-dev")
endif()
include(${VERGE_PACKAGE_DIR}/cpack.cmake)
