# The command as WebAssembly (emscripten; preset `wasm`): build-wasm/krot.js and
# krot.wasm, which src/browser makes a page of. See docs/browser.md.

# krot_browser_link(<target>)
#
# A function createKrot() that makes an instance with a file system of its own;
# its callMain runs one command. -O1 is for this step alone: to optimise the
# whole once more takes a minute and makes no command faster.
function(krot_browser_link target)
  target_link_options(${target} PRIVATE -O1
    -sMODULARIZE=1 -sEXPORT_NAME=createKrot -sINVOKE_RUN=0
    -sFORCE_FILESYSTEM=1 -sEXPORTED_RUNTIME_METHODS=FS,callMain
    -sALLOW_MEMORY_GROWTH=1 -sMAXIMUM_MEMORY=4GB -sENVIRONMENT=worker,node)
endfunction()
