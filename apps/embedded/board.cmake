# verge_board(TARGET): the board that a program is built for, by the processor of the toolchain.
set(VERGE_BOARD_DIR ${CMAKE_CURRENT_LIST_DIR})
function(verge_board target)
    target_include_directories(${target} PRIVATE ${VERGE_BOARD_DIR})
    if(CMAKE_SYSTEM_NAME STREQUAL Generic)
        target_sources(${target} PRIVATE ${VERGE_BOARD_DIR}/board.c)
        target_link_options(${target} PRIVATE
            -T ${VERGE_BOARD_DIR}/mps2-an500.ld --specs=nosys.specs)
        # The C++ of core uses no C++ library: it is not linked.
        set_target_properties(${target} PROPERTIES LINKER_LANGUAGE C SUFFIX .elf
            LINK_DEPENDS ${VERGE_BOARD_DIR}/mps2-an500.ld)
    else()
        target_sources(${target} PRIVATE ${VERGE_BOARD_DIR}/desktop.c)
    endif()
endfunction()
